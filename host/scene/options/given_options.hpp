// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "raysplats/error.hpp"
#include "scene/options/option_table.hpp"

namespace raysplats {

/// Options that a user gave, by the rows of a table, to go over others.
template <class Options, std::vector<OptionRow> (*rows_of)(Options&)>
class GivenOptions {
 public:
  /// Throws UsageError for a name that has no row, and for values that it does not accept.
  void set(const std::string& name, const std::vector<std::string>& values) {
    Options scratch;
    row_of(rows_of(scratch), name).set(values);
    given_.push_back({name, values});
  }
  bool has(const std::string& name) const {
    return std::any_of(given_.begin(), given_.end(),
                       [&](const Given& each) { return each.name == name; });
  }
  Options over(Options base) const {
    const std::vector<OptionRow> rows = rows_of(base);
    for (const Given& each : given_) row_of(rows, each.name).set(each.values);
    return base;
  }

 private:
  struct Given {
    std::string name;
    std::vector<std::string> values;
  };

  static const OptionRow& row_of(const std::vector<OptionRow>& rows, const std::string& name) {
    const OptionRow* row = find_row(rows, name);
    if (row == nullptr) throw UsageError(fmt::format("There is no option '{}' here", name));
    return *row;
  }

  std::vector<Given> given_;
};

}  // namespace raysplats
