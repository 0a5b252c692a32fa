// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

namespace raysplats::io {

constexpr int kMaxJsonDepth = 32;

/// Parses a JSON file whose root is an object, of bounded size and depth. Throws DataError with the
/// line.
nlohmann::json read_json_object(const std::filesystem::path& path);
/// The same of what is in memory already; `path` names it in errors.
nlohmann::json parse_json_object(std::span<const std::byte> bytes,
                                 const std::filesystem::path& path,
                                 int max_depth = kMaxJsonDepth);

/// Whether an object has `key` and it is true.
bool json_flag(const nlohmann::json& json, const char* key);

}  // namespace raysplats::io
