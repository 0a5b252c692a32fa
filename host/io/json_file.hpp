// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>

namespace raysplats::io {

/// Parses a JSON file whose root is an object, of bounded size and depth. Throws DataError with the
/// byte offset.
nlohmann::json read_json_object(const std::filesystem::path& path);
/// The same of what is in memory already; `path` names it in errors.
nlohmann::json parse_json_object(std::span<const std::byte> bytes,
                                 const std::filesystem::path& path);

}  // namespace raysplats::io
