// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "core/option_table.hpp"
#include "raysplats/train_options.hpp"

namespace raysplats {

/// Every training option, the key of the configuration files and with "--" of the command line,
/// bound to the members of `options`, in the order of the documentation. The keys refer to
/// `options`, which has to outlive them.
std::vector<OptionRow> train_keys(TrainOptions& options);

}  // namespace raysplats
