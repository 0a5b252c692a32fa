// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "util/number_text.hpp"

namespace raysplats {

/// One option: the key of configuration and scene files and, with "--", of the command line.
struct OptionRow {
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

/// The row of that name, or null.
const OptionRow* find_row(const std::vector<OptionRow>& rows, const std::string& name);
/// Throws UsageError for a present value that its row would refuse, as programs may set it.
void check_values(const std::vector<OptionRow>& rows);

/// Upper bound of 64-bit seeds, as a double.
constexpr double kMaxSeed = 0x1p64;

/// A number in the spellings of number_text.hpp. Throws UsageError that names the key and the
/// range.
template <class T>
T option_number(const std::string& key, const std::string& text, double low, double high);
/// The only value. Throws UsageError for none or several.
const std::string& option_value(std::string_view key, const std::vector<std::string>& values);
/// The items of a list in any spelling. Throws UsageError for what is none.
std::vector<std::string> option_items(const std::string& key,
                                      const std::vector<std::string>& values);
/// The text as TOML that needs no escapes.
std::string toml_text(const std::string& text);

/// What begins and ends a text of several lines in TOML, and is no part of one.
constexpr std::string_view kTomlLines = "'''";
/// A text of whole lines as TOML.
std::string toml_lines(const std::string& text);
/// A present value for a message: of a text of several lines how many they are, without comments.
std::string brief_value(const std::string& toml);

/// Collects options: every function adds one, bound to a member, which has to outlive the row.
/// Name, range, default, help and setter of an option are told there and nowhere else.
class OptionTable {
 public:
  using Values = std::vector<std::string>;

  /// Heading of what follows.
  void section(std::string name) { section_ = std::move(name); }

  /// A number from `low` to `high`; whole for integer types.
  template <class T>
  void number(const std::string& name, T& target, double low, double high, const std::string& help);
  void flag(const std::string& name, bool& target, const std::string& help);
  template <class E>
  void choice(const std::string& name,
              E& target,
              const std::vector<std::pair<std::string, E>>& names,
              const std::string& help);
  void text(const std::string& name, std::string& target, const std::string& help);
  /// A word, or numbers in any spelling of a list, kept as "r,g,b".
  void words(const std::string& name, std::string& target, const std::string& help);
  /// Three numbers from 0 to `high`, or one for a grey.
  void color(const std::string& name,
             std::array<float, 3>& target,
             const std::string& help,
             double high = 1);
  /// Absolute ones are kept, so that they are found from anywhere. A path may hold what separates
  /// the items of other lists, so that one value is one path.
  void paths(const std::string& name, std::vector<std::string>& target, const std::string& help);
  /// A row of any other kind.
  void add(const std::string& name,
           const std::string& help,
           std::function<void(const Values&)> set,
           std::function<std::string()> text,
           OptionRow::List list = OptionRow::List::kNone);

  std::vector<OptionRow> take() { return std::move(rows_); }

 private:
  void add_choice(const std::string& name,
                  const std::vector<std::string>& labels,
                  const std::string& help,
                  const std::function<void(std::size_t)>& store,
                  const std::function<std::size_t()>& chosen);

  std::string section_;
  std::vector<OptionRow> rows_;
};

template <class E>
void OptionTable::choice(const std::string& name,
                         E& target,
                         const std::vector<std::pair<std::string, E>>& names,
                         const std::string& help) {
  std::vector<std::string> labels;
  labels.reserve(names.size());
  for (const auto& each : names) labels.push_back(each.first);
  add_choice(
      name, labels, help,
      [&target, names](std::size_t chosen) { target = names.at(chosen).second; },
      [&target, names] {
        std::size_t i = 0;
        while (i < names.size() && names[i].second != target) ++i;
        return i;
      });
}

}  // namespace raysplats
