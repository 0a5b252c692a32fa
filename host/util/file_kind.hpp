// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <system_error>

#include "raysplats/error.hpp"

namespace raysplats {

/// Whether there is a folder, or a file, at the path; not when it cannot be asked.
inline bool is_folder(const std::filesystem::path& path) {
  std::error_code error;
  return std::filesystem::is_directory(path, error);
}

inline bool is_file(const std::filesystem::path& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(path, error);
}

/// Whether there is something at a path that somebody has given. Throws DataError that says why it
/// cannot be asked: a folder on the way that may not be entered, a name that is too long, links
/// that lead around.
inline bool is_there(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::status_known(status))
    throw DataError(path.string() + " cannot be read: " + error.message());
  return std::filesystem::exists(status);
}

/// Whether the name is that of an AppleDouble file, "._NAME", in which macOS keeps what other file
/// systems have no place for: it ends as NAME does but holds none of it.
inline bool is_apple_double(const std::filesystem::path& path) {
  return path.filename().string().starts_with("._");
}

}  // namespace raysplats
