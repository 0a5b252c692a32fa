// SPDX-License-Identifier: Apache-2.0
#include "util/shell_word.hpp"

#include <algorithm>
#include <cctype>

namespace raysplats {

std::string shell_quoted(std::string_view text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

std::string shell_word(std::string_view text) {
  const bool plain = !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 ||
           std::string_view("-_=./:,+@%").find(static_cast<char>(c)) != std::string_view::npos;
  });
  return plain ? std::string(text) : shell_quoted(text);
}

}  // namespace raysplats
