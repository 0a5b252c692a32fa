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
  enum class List { kNone, kNumbers, kPaths };
  List list = List::kNone;  ///< of lists, every use on the command line adds to them
  /// Parses and stores the value, or the values of a list in any spelling (list_items()); throws
  /// UsageError that names the key and what it accepts.
  std::function<void(const std::vector<std::string>&)> set;
  /// The present value as TOML.
  std::function<std::string()> text;
};

/// Every training option, bound to the members of `options`, in the order of the documentation. The
/// keys refer to `options`, which has to outlive them.
std::vector<TrainKey> train_keys(TrainOptions& options);

}  // namespace raysplats
