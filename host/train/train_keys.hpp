// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "raysplats/train_options.hpp"

namespace raysplats {

/// One training option: the key of the configuration files and, with "--", of the command line.
struct TrainKey {
  std::string name;
  std::string section;  ///< heading it is listed under
  std::string help;
  bool flag = false;  ///< true or false; on the command line it needs no value
  /// Parses and stores; throws UsageError that names the key and what it accepts.
  std::function<void(const std::vector<std::string>&)> set;
  /// The present value as TOML.
  std::function<std::string()> text;
  bool repeatable = false;  ///< a list to which every use on the command line adds
};

/// Every training option, bound to the members of `options`, in the order of the documentation. The
/// keys refer to `options`, which has to outlive them.
std::vector<TrainKey> train_keys(TrainOptions& options);

}  // namespace raysplats
