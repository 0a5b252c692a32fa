// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

namespace raysplats::io {

/// Parses a JSON file whose root is an object, of bounded size and depth. Throws DataError with the
/// byte offset.
nlohmann::json read_json_object(const std::filesystem::path& path);

}  // namespace raysplats::io
