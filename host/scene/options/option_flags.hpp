// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "scene/options/option_table.hpp"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace raysplats {

/// Adds a row to a command line as "--NAME" and "--no-NAME" for flags; `names` are spellings before
/// that ("-n"). `set` takes the values in the place of row.set.
CLI::Option* add_row(CLI::App& app,
                     const OptionRow& row,
                     std::function<void(const std::vector<std::string>&)> set,
                     const std::string& names = {});

}  // namespace raysplats
