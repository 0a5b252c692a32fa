// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

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

/// Whether the name is that of an AppleDouble file, "._NAME", in which macOS keeps what other file
/// systems have no place for: it ends as NAME does but holds none of it.
inline bool is_apple_double(const std::filesystem::path& path) {
  return path.filename().string().starts_with("._");
}

}  // namespace raysplats
