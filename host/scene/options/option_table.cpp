// SPDX-License-Identifier: Apache-2.0
#include "scene/options/option_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "raysplats/error.hpp"
#include "util/utf8.hpp"

namespace raysplats {
namespace {

// What toml_text() can hold.
const std::string& quotable(const std::string& key, const std::string& value) {
  const bool bad = std::any_of(value.begin(), value.end(), [](char c) {
    return c == '"' || static_cast<unsigned char>(c) < 0x20;
  });
  const bool both = value.find('\\') != std::string::npos && value.find('\'') != std::string::npos;
  if (bad || both) {
    throw UsageError(fmt::format(
        "The option '{}' takes no double quotes, no control characters and no single quotes "
        "beside backslashes",
        key));
  }
  // As TOML is; a configuration with anything else could not be read again.
  if (!is_utf8(value)) {
    throw UsageError(
        fmt::format("The option '{}' takes UTF-8 alone, as configurations are written in: give the "
                    "file or folder another name",
                    key));
  }
  return value;
}

// What toml_lines() has made a value of.
std::optional<std::string> lines_of(const std::string& toml) {
  const std::string begin = fmt::format("{}\n", kTomlLines);
  if (!toml.starts_with(begin)) return std::nullopt;
  return toml.substr(begin.size(), toml.size() - begin.size() - kTomlLines.size());
}

// What set() takes for the present value.
std::vector<std::string> present_values(const OptionRow& row) {
  const std::string text = row.text();
  // Paths may hold what separates the items of other lists.
  if (row.list == OptionRow::List::kPaths) return option_items(row.name, {text});
  if (const std::optional<std::string> lines = lines_of(text)) return {*lines};
  const bool quoted = text.size() > 1 && (text.front() == '"' || text.front() == '\'');
  return {quoted ? text.substr(1, text.size() - 2) : text};
}

}  // namespace

const OptionRow* find_row(const std::vector<OptionRow>& rows, const std::string& name) {
  const auto found = std::find_if(rows.begin(), rows.end(),
                                  [&](const OptionRow& row) { return row.name == name; });
  return found == rows.end() ? nullptr : &*found;
}

void check_values(const std::vector<OptionRow>& rows) {
  for (const OptionRow& row : rows) row.set(present_values(row));
}

template <class T>
T option_number(const std::string& key, const std::string& text, double low, double high) {
  std::optional<T> value;
  if constexpr (std::is_floating_point_v<T>) {
    if (const std::optional<double> real = parse_real(text)) value = static_cast<T>(*real);
  } else if constexpr (std::is_unsigned_v<T>) {
    value = parse_natural(text);
  } else if (const std::optional<std::int64_t> whole = parse_whole(text)) {
    if (std::in_range<T>(*whole)) value = static_cast<T>(*whole);
  }
  // As they were written: a float's rounding must not leave the range.
  const double number = std::is_floating_point_v<T> ? parse_real(text).value_or(low)
                                                    : static_cast<double>(value.value_or(T{}));
  if (!value || number < low || number > high) {
    // A bound that goes without saying is said to who is beyond it.
    const std::string upper =
        number > high && high >= kNoBound ? fmt::format(" and at most {}", high) : "";
    throw UsageError(fmt::format("The option '{}' needs {}{}, not '{}'", key,
                                 number_words(std::is_integral_v<T>, low, high), upper, text));
  }
  return *value;
}

template int option_number<int>(const std::string&, const std::string&, double, double);
template std::int64_t option_number<std::int64_t>(const std::string&,
                                                  const std::string&,
                                                  double,
                                                  double);
template std::uint64_t option_number<std::uint64_t>(const std::string&,
                                                    const std::string&,
                                                    double,
                                                    double);
template float option_number<float>(const std::string&, const std::string&, double, double);
template double option_number<double>(const std::string&, const std::string&, double, double);

const std::string& option_value(std::string_view key, const std::vector<std::string>& values) {
  if (values.size() != 1) {
    throw UsageError(fmt::format("The option '{}' takes one value, not {}", key, values.size()));
  }
  return values.front();
}

std::vector<std::string> option_items(const std::string& key,
                                      const std::vector<std::string>& values) {
  std::optional<std::vector<std::string>> list = list_items(values);
  if (!list) {
    throw UsageError(fmt::format("The option '{}' is a list as in [1, 2], not '{}'", key,
                                 fmt::join(values, " ")));
  }
  return std::move(*list);
}

std::string toml_text(const std::string& text) {
  const char quote = text.find('\\') == std::string::npos ? '"' : '\'';
  return quote + text + quote;
}

std::string toml_lines(const std::string& text) {
  return fmt::format("{0}\n{1}{0}", kTomlLines, text);
}

std::string brief_value(const std::string& toml) {
  const std::optional<std::string> lines = lines_of(toml);
  if (!lines) return toml;
  std::size_t count = 0;
  for (std::size_t at = 0; at < lines->size(); at = lines->find('\n', at) + 1)
    count += (*lines)[at] == '#' ? 0 : 1;
  return fmt::format("a list of {}", count);
}

void OptionTable::add(const std::string& name,
                      const std::string& help,
                      std::function<void(const Values&)> set,
                      std::function<std::string()> text,
                      OptionRow::List list) {
  rows_.push_back({name, section_, help, false, list, std::move(set), std::move(text)});
}

template <class T>
void OptionTable::number(
    const std::string& name, T& target, double low, double high, const std::string& help) {
  add(
      name, help,
      [name, &target, low, high](const Values& values) {
        target = option_number<T>(name, option_value(name, values), low, high);
      },
      [&target] {
        // TOML's integers end before unsigned ones do.
        const bool beyond = std::is_unsigned_v<T> && static_cast<double>(target) >= 0x1p63;
        const std::string text = fmt::format("{}", target);
        return beyond ? toml_text(text) : text;
      });
}

template void OptionTable::number<int>(
    const std::string&, int&, double, double, const std::string&);
template void OptionTable::number<std::int64_t>(
    const std::string&, std::int64_t&, double, double, const std::string&);
template void OptionTable::number<std::uint64_t>(
    const std::string&, std::uint64_t&, double, double, const std::string&);
template void OptionTable::number<float>(
    const std::string&, float&, double, double, const std::string&);
template void OptionTable::number<double>(
    const std::string&, double&, double, double, const std::string&);

void OptionTable::flag(const std::string& name, bool& target, const std::string& help) {
  add(
      name, help,
      [name, &target](const Values& values) {
        const std::string& text = option_value(name, values);
        if (text != "true" && text != "false") {
          throw UsageError(fmt::format("The option '{}' is true or false, not '{}'", name, text));
        }
        target = text == "true";
      },
      [&target] { return std::string(target ? "true" : "false"); });
  rows_.back().flag = true;
}

void OptionTable::add_choice(const std::string& name,
                             const std::vector<std::string>& labels,
                             const std::string& help,
                             const std::function<void(std::size_t)>& store,
                             const std::function<std::size_t()>& chosen) {
  add(
      name, help,
      [name, labels, store](const Values& values) {
        const std::string& text = option_value(name, values);
        const auto found = std::find(labels.begin(), labels.end(), text);
        if (found == labels.end()) {
          throw UsageError(fmt::format("The option '{}' is {}, not '{}'", name,
                                       fmt::join(labels, " or "), text));
        }
        store(static_cast<std::size_t>(found - labels.begin()));
      },
      [name, labels, chosen] {
        const std::size_t at = chosen();
        // As programs may set it.
        if (at >= labels.size()) {
          throw UsageError(fmt::format("The option '{}' is {}, not a value without a name", name,
                                       fmt::join(labels, " or ")));
        }
        return toml_text(labels[at]);
      });
}

void OptionTable::text(const std::string& name, std::string& target, const std::string& help) {
  add(
      name, help,
      [name, &target](const Values& values) {
        target = quotable(name, option_value(name, values));
      },
      [&target] { return toml_text(target); });
}

void OptionTable::words(const std::string& name, std::string& target, const std::string& help) {
  add(
      name, help,
      [name, &target](const Values& values) {
        target = quotable(name, fmt::format("{}", fmt::join(option_items(name, values), ",")));
      },
      [&target] { return toml_text(target); });
}

void OptionTable::color(const std::string& name,
                        std::array<float, 3>& target,
                        const std::string& help,
                        double high) {
  add(
      name, help,
      [name, &target, high](const Values& values) {
        const std::optional<std::vector<std::string>> parts = list_items(values);
        std::array<float, 3> color{};
        bool good = parts && (parts->size() == 3 || parts->size() == 1);
        for (std::size_t k = 0; good && k < color.size(); ++k) {
          const std::optional<double> value = parse_real(parts->at(parts->size() == 1 ? 0 : k));
          good = value && *value >= 0 && *value <= high;
          color[k] = static_cast<float>(value.value_or(0.0));
        }
        if (!good) {
          throw UsageError(
              fmt::format("The option '{}' is three numbers from 0 to {}, as in 1,0.5,0, not '{}'",
                          name, high, fmt::join(values, " ")));
        }
        target = color;
      },
      [&target] { return fmt::format("[{}]", fmt::join(target, ", ")); });
}

void OptionTable::paths(const std::string& name,
                        std::vector<std::string>& target,
                        const std::string& help) {
  add(
      name, help,
      [name, &target](const Values& values) {
        target.clear();
        for (const std::string& value : values) {
          if (value.empty() || value == "[]") continue;
          target.push_back(quotable(name, std::filesystem::absolute(value).string()));
        }
      },
      [&target] {
        std::vector<std::string> texts;
        texts.reserve(target.size());
        for (const std::string& path : target) texts.push_back(toml_text(path));
        return fmt::format("[{}]", fmt::join(texts, ", "));
      },
      OptionRow::List::kPaths);
}

}  // namespace raysplats
