// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "raysplats/train_options.hpp"
#include "scene/options/option_table.hpp"

namespace raysplats {

/// Every training option, the key of the configuration files and with "--" of the command line,
/// bound to the members of `options`, in the order of the documentation. The keys refer to
/// `options`, which has to outlive them.
std::vector<OptionRow> train_option_rows(TrainOptions& options);
/// Throws UsageError for options that these keys would refuse, as programs may set them.
void check_train_options(TrainOptions options);

/// A key of earlier versions that nothing reads any more, and what there is instead.
struct RetiredKey {
  std::string name, instead;
};
const std::vector<RetiredKey>& retired_train_keys();
/// Whether it is one of them: commands and files of earlier versions go on working, with a warning.
bool take_retired_key(const std::string& name);

}  // namespace raysplats
