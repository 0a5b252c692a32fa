// SPDX-License-Identifier: Apache-2.0
#include "io/json_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <string_view>

#include "io/byte_reader.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {
constexpr std::uint64_t kMaxBytes = std::uint64_t{256} << 20;
constexpr std::size_t kMostLetters = 20;  // of a word that is named

/// Where a parser stopped and what is there, as far as it is a word.
std::string place_of(std::string_view text, std::size_t byte) {
  const std::string_view before = text.substr(0, byte > 0 ? byte - 1 : 0);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  // Parsers stop behind the first letter that does not belong, as in the middle of "nan".
  const auto part_of_word = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; };
  std::size_t begin = std::min(before.size(), text.size());
  while (begin > 0 && part_of_word(text[begin - 1])) --begin;
  std::size_t end = begin;
  while (end < text.size() && end < begin + kMostLetters && part_of_word(text[end])) ++end;
  return fmt::format("line {}{}", line,
                     end > begin ? fmt::format(" by '{}'", text.substr(begin, end - begin)) : "");
}

}  // namespace

nlohmann::json read_json_object(const std::filesystem::path& path) {
  return parse_json_object(read_file(path, kMaxBytes), path);
}

nlohmann::json parse_json_object(std::span<const std::byte> bytes,
                                 const std::filesystem::path& path,
                                 int max_depth) {
  const auto* begin = reinterpret_cast<const char*>(bytes.data());
  const auto check_depth = [&](int depth, nlohmann::json::parse_event_t, nlohmann::json&) {
    if (depth > max_depth) {
      throw DataError(
          fmt::format("{} is nested more than {} levels deep", path.string(), max_depth));
    }
    return true;
  };
  nlohmann::json root;
  try {
    root = nlohmann::json::parse(begin, begin + bytes.size(), check_depth);
  } catch (const nlohmann::json::parse_error& error) {
    const std::string_view text(begin, bytes.size());
    throw DataError(fmt::format("{} is no valid JSON: syntax error in {}", path.string(),
                                place_of(text, error.byte)));
  } catch (const nlohmann::json::exception&) {
    throw DataError(fmt::format("{} is no valid JSON: a number is out of range", path.string()));
  }
  if (!root.is_object()) throw DataError(fmt::format("{} holds no JSON object", path.string()));
  return root;
}

bool json_flag(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_boolean() && found->get<bool>();
}

}  // namespace raysplats::io
