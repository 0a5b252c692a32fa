// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace raysplats {

/// A bound from here on is none: what a range says is "at least", or nothing.
constexpr double kNoBound = 1e30;

/// "a whole number from 1 to 1000", "a number of at least 0": what a range accepts, in words.
std::string number_words(bool whole, double low, double high);

/// "1 photo", "3 photos": a whole number of things below 2^53; `many` where an s at the end does
/// not do.
std::string counted(double count, std::string_view one, std::string_view many = {});

/// The number that the whole of a text is, in the spellings of TOML (1_000, 1e4) and of shells;
/// none for any other text and for numbers that are not finite. Whole numbers may be written as
/// 1e4 and with a letter for thousands or millions behind them, as in 10k and 1.5M.
std::optional<double> parse_real(std::string_view text);
std::optional<std::int64_t> parse_whole(std::string_view text);
std::optional<std::uint64_t> parse_natural(std::string_view text);

/// The items of a list in every spelling that a configuration file or a shell user would try:
/// {"5", "10"}, {"5,10"}, {"5 10"}, {"[5, 10]"}, {"=[5,", "10]"}; none of them for {}, {""} and
/// {"[]"}. No value where the text is no list: brackets that do not match, commas without an item
/// before them.
std::optional<std::vector<std::string>> list_items(const std::vector<std::string>& values);

/// Whether a word can only be a part of a list of numbers: "[5,", "10]", "-1", "0.5,1", "100k".
bool is_number_list_part(std::string_view word);

}  // namespace raysplats
