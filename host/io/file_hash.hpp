// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace raysplats::io {

/// The XXH3 of 128 bits of a file, or of at most `bytes` of it from `begin`, in hexadecimal digits
/// as `xxh128sum` prints it; nothing where it cannot be read.
std::optional<std::string> file_hash(const std::filesystem::path& file,
                                     std::uintmax_t begin = 0,
                                     std::uintmax_t bytes = UINTMAX_MAX);

}  // namespace raysplats::io
