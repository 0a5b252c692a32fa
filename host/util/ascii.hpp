// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace raysplats {

/// A to Z in small letters; all else stays, whatever the locale, which may take single bytes of a
/// character of UTF-8 for letters.
constexpr char ascii_lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}
inline std::string ascii_lower(std::string text) {
  for (char& c : text) c = ascii_lower(c);
  return text;
}

}  // namespace raysplats
