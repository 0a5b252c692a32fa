// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <system_error>

namespace raysplats {

/// Makes sure that `path` is a folder that files can be written to, creating it and its parents
/// when needed. Throws DataError with the system's reason.
void make_output_directory(const std::filesystem::path& path);

/// Throws what make_output_directory() would for `path`, as far as that is known beforehand; makes
/// nothing.
void check_output_directory(const std::filesystem::path& path);

/// Why nothing can be kept in `folder`, which is made where it is missing; no error when it can. A
/// file is written there and removed: a folder may be writable and its disk full.
std::error_code writing_trouble(const std::filesystem::path& folder);

}  // namespace raysplats
