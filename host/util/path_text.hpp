// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace raysplats {

/// The extension in small letters, with its dot; letters beyond ASCII stay as they are.
std::string lower_extension(const std::filesystem::path& path);

/// A path as a file names it that may have been written on Windows: every backslash separates.
std::filesystem::path portable_path(std::string text);

}  // namespace raysplats
