// SPDX-License-Identifier: Apache-2.0
#include "scene/options/option_flags.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <utility>

namespace raysplats {

CLI::Option* add_row(CLI::App& app,
                     const OptionRow& row,
                     std::function<void(const std::vector<std::string>&)> set,
                     const std::string& names) {
  const std::string all = fmt::format("{}{}--{}", names, names.empty() ? "" : ",", row.name);
  if (row.flag) {
    return app.add_flag_function(
        fmt::format("{},!--no-{}", all, row.name),
        [set = std::move(set)](std::int64_t count) { set({count > 0 ? "true" : "false"}); },
        row.help);
  }
  const bool list = row.list != OptionRow::List::kNone;
  CLI::Option* option = app.add_option_function<std::vector<std::string>>(all, set, row.help);
  // One word per use: further ones would swallow the data set's name.
  option->expected(1)->allow_extra_args(false);
  option->type_name(list ? "LIST" : "VALUE");
  option->multi_option_policy(list ? CLI::MultiOptionPolicy::TakeAll
                                   : CLI::MultiOptionPolicy::TakeLast);
  return option;
}

}  // namespace raysplats
