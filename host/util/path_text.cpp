// SPDX-License-Identifier: Apache-2.0
#include "util/path_text.hpp"

#include <algorithm>
#include <utility>

#include "util/ascii.hpp"

namespace raysplats {

std::string lower_extension(const std::filesystem::path& path) {
  return ascii_lower(path.extension().string());
}

std::filesystem::path portable_path(std::string text) {
  std::replace(text.begin(), text.end(), '\\', '/');
  return std::filesystem::path(std::move(text));
}

}  // namespace raysplats
