// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "raysplats/dataset.hpp"
#include "scene/options/given_options.hpp"
#include "scene/options/option_table.hpp"

namespace raysplats {

/// How a data set is read: the same on every command line, in [camera] of scene files and in
/// training configurations.
void add_data_options(OptionTable& table, DatasetOptions& options);

/// These rows, bound to `options`.
std::vector<OptionRow> data_option_rows(DatasetOptions& options);

/// Throws UsageError: of --test-every and --test-list only one can be heeded.
[[noreturn]] void refuse_two_splits();

class DataSettings : public GivenOptions<DatasetOptions, data_option_rows> {
 public:
  /// A number of --test-every goes before the list of a run. Throws UsageError for both.
  DatasetOptions over(DatasetOptions base) const;
};

}  // namespace raysplats
