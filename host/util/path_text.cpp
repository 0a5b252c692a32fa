// SPDX-License-Identifier: Apache-2.0
#include "util/path_text.hpp"

#include <algorithm>
#include <utility>

namespace raysplats {

std::string lower_extension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  // Not by the locale, which takes single bytes for letters.
  for (char& c : extension) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return extension;
}

std::filesystem::path portable_path(std::string text) {
  std::replace(text.begin(), text.end(), '\\', '/');
  return std::filesystem::path(std::move(text));
}

}  // namespace raysplats
