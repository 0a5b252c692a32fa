// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "raysplats/dataset.hpp"
#include "scene/given_options.hpp"
#include "scene/option_table.hpp"

namespace raysplats {

/// How a data set is read: the same on every command line, in [camera] of scene files and in
/// training configurations.
void add_data_options(OptionTable& table, DatasetOptions& options);

/// These rows, bound to `options`.
std::vector<OptionRow> data_option_rows(DatasetOptions& options);

using DataSettings = GivenOptions<DatasetOptions, data_option_rows>;

}  // namespace raysplats
