// SPDX-License-Identifier: Apache-2.0
#include "util/number_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <type_traits>

namespace raysplats {
namespace {

constexpr std::string_view kDigits = "0123456789";
constexpr std::string_view kSpaces = " \t\r\n";

/// Without the underscores between digits and without a leading plus, which from_chars does not
/// take; "" where an underscore stands elsewhere.
std::string plain(std::string_view text) {
  std::string out;
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '_') {
      out += text[i];
      continue;
    }
    const auto digit = [&](std::size_t at) {
      return at < text.size() && kDigits.find(text[at]) != std::string_view::npos;
    };
    if (i == 0 || !digit(i - 1) || !digit(i + 1)) return "";
  }
  return out;
}

template <class T>
std::optional<T> parse_all(const std::string& text) {
  T value{};
  const char* end = text.data() + text.size();
  const auto [next, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || next != end) return std::nullopt;
  return value;
}

/// What a letter for thousands or millions at the end stands for, which is taken off.
double take_factor(std::string_view& text) {
  if (text.size() < 2 || kDigits.find(text[text.size() - 2]) == std::string_view::npos) return 1;
  const double factor = text.back() == 'k' ? 1e3 : text.back() == 'M' ? 1e6 : 1;
  if (factor > 1) text.remove_suffix(1);
  return factor;
}

template <class T>
std::optional<T> parse_integer(std::string_view text) {
  if (const std::optional<T> value = parse_all<T>(plain(text))) return value;
  constexpr double kExact = 9007199254740992.0;  // 2^53: larger ones are not what was written
  const double factor = take_factor(text);
  const std::optional<double> real = parse_real(text);
  if (!real) return std::nullopt;
  // 0.29M is 290 000, though the product of the two is not quite.
  const double value = std::round(*real * factor);
  if (std::abs(value) > kExact || std::abs(value - *real * factor) > 1e-9 * (factor - 1)) {
    return std::nullopt;
  }
  if (std::is_unsigned_v<T> && value < 0) return std::nullopt;
  return static_cast<T>(value);
}

}  // namespace

std::string counted(double count, std::string_view one, std::string_view many) {
  const std::string number = fmt::format("{:.0f}", count);
  if (number == "1") return fmt::format("1 {}", one);
  return many.empty() ? fmt::format("{} {}s", number, one) : fmt::format("{} {}", number, many);
}

std::string number_words(bool whole, double low, double high) {
  const char* kind = whole ? "a whole number" : "a number";
  if (high >= kNoBound) {
    return low <= -kNoBound ? kind : fmt::format("{} of at least {}", kind, low);
  }
  return fmt::format("{} from {} to {}", kind, low, high);
}

std::optional<double> parse_real(std::string_view text) {
  const std::optional<double> value = parse_all<double>(plain(text));
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::optional<std::int64_t> parse_whole(std::string_view text) {
  return parse_integer<std::int64_t>(text);
}

std::optional<std::uint64_t> parse_natural(std::string_view text) {
  return parse_integer<std::uint64_t>(text);
}

std::optional<std::vector<std::string>> list_items(const std::vector<std::string>& values) {
  std::vector<std::string> items;
  bool open = false;
  bool separated = true;  // nothing that a comma could follow
  for (std::string_view text : values) {
    // What -h prints after an option begins with "=" in some shells' completions and habits.
    if (!text.empty() && text.front() == '=') text.remove_prefix(1);
    std::size_t i = 0;
    while (i < text.size()) {
      const char c = text[i];
      if (kSpaces.find(c) != std::string_view::npos) {
        ++i;
      } else if (c == '[' || c == ']') {
        if (open == (c == '[')) return std::nullopt;
        open = !open;
        separated = c == '[';
        ++i;
      } else if (c == ',') {
        if (separated) return std::nullopt;
        separated = true;
        ++i;
      } else {
        std::size_t end = std::min(text.find_first_of(" \t\r\n,[]", i), text.size());
        if (c == '"' || c == '\'') {
          end = text.find(c, i + 1);
          if (end == std::string_view::npos) return std::nullopt;
          items.emplace_back(text.substr(i + 1, end - i - 1));
          ++end;
        } else {
          items.emplace_back(text.substr(i, end - i));
        }
        separated = false;
        i = end;
      }
    }
  }
  if (open) return std::nullopt;
  return items;
}

namespace {

/// A number, with a letter for thousands or millions behind it, or a pair as in 4:0.1.
bool is_number_or_pair(std::string_view text) {
  if (const std::size_t colon = text.find(':'); colon != std::string_view::npos) {
    return is_number_or_pair(text.substr(0, colon)) && is_number_or_pair(text.substr(colon + 1));
  }
  take_factor(text);
  return parse_real(text).has_value();
}

}  // namespace

bool is_number_list_part(std::string_view word) {
  if (word.empty()) return false;
  while (!word.empty()) {
    const std::size_t end = std::min(word.find_first_of("[],= "), word.size());
    if (end > 0 && !is_number_or_pair(word.substr(0, end))) return false;
    word.remove_prefix(std::min(end + 1, word.size()));
  }
  return true;
}

}  // namespace raysplats
