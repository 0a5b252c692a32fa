// SPDX-License-Identifier: Apache-2.0
#include "validators.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>

#include "util/number_text.hpp"

namespace raysplats::cli {
namespace {

/// Refuses what is not `wanted`, and writes what is so that CLI11 reads the same.
CLI::Validator number_check(const std::string& wanted, const std::function<bool(double)>& valid) {
  return CLI::Validator(
      [=](std::string& text) {
        const std::optional<double> value = parse_real(text);
        if (!value || !valid(*value)) return fmt::format("{} is not {}", text, wanted);
        text = fmt::format("{}", *value);
        return std::string();
      },
      "");
}

/// That many numbers with commas; `said` is how the sentence that refuses others puts it.
CLI::Validator numbers(std::size_t count, const char* said) {
  return CLI::Validator(
      [count, said](const std::string& text) {
        const std::optional<std::vector<std::string>> parts = list_items({text});
        const bool good = parts && parts->size() == count &&
                          std::all_of(parts->begin(), parts->end(), [](const std::string& part) {
                            return parse_real(part).has_value();
                          });
        return good ? std::string() : fmt::format("'{}' is not {}", text, said);
      },
      "");
}

template <std::size_t kCount>
std::array<double, kCount> parse_numbers(const std::string& text) {
  const std::vector<std::string> parts = list_items({text}).value_or(std::vector<std::string>());
  std::array<double, kCount> out{};
  for (std::size_t k = 0; k < kCount; ++k) out[k] = parse_real(parts.at(k)).value_or(0.0);
  return out;
}

}  // namespace

CLI::Validator above(double low) {
  return number_check(fmt::format("a number above {}", low), [low](double v) { return v > low; });
}

CLI::Validator between(double low, double high) {
  return number_check(number_words(false, low, high),
                      [=](double v) { return v >= low && v <= high; });
}

CLI::Validator whole_between(double low, double high) {
  return CLI::Validator(
      [=](std::string& text) {
        const std::optional<std::int64_t> value = parse_whole(text);
        const auto number = static_cast<double>(value.value_or(0));
        if (!value || number < low || number > high) {
          return fmt::format("{} is not {}", text, number_words(true, low, high));
        }
        text = std::to_string(*value);
        return std::string();
      },
      "");
}

CLI::Validator seed() {
  return CLI::Validator(
      [](std::string& text) {
        const std::optional<std::uint64_t> value = parse_natural(text);
        if (!value) {
          return fmt::format("{} is not a whole number from 0 to 18446744073709551615", text);
        }
        text = std::to_string(*value);
        return std::string();
      },
      "");
}

CLI::Validator one_of(std::vector<std::string> names) {
  const std::string name = fmt::format("{}", fmt::join(names, "|"));
  return CLI::Validator(
      [names = std::move(names)](const std::string& text) {
        if (std::find(names.begin(), names.end(), text) != names.end()) return std::string();
        return fmt::format("'{}' is none of {}", text, fmt::join(names, ", "));
      },
      "", name);
}

CLI::Validator not_empty() {
  return CLI::Validator(
      [](const std::string& text) {
        return std::string(text.empty() ? "the name is empty: give one" : "");
      },
      "");
}

CLI::Validator triple() { return numbers(3, "three numbers with commas, as in 1,0.5,0"); }

std::array<double, 3> parse_triple(const std::string& text) { return parse_numbers<3>(text); }

CLI::Validator box() {
  return numbers(6, "least and greatest x, y, z with commas, as in -1,-1,0,1,1,2");
}

std::array<double, 6> parse_box(const std::string& text) { return parse_numbers<6>(text); }

}  // namespace raysplats::cli
