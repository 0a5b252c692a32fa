// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>

#include "raysplats/error.hpp"

namespace raysplats::io {

/// Why a library cannot read or write a picture, on one line: each line that it says once, without
/// the picture's name in front.
inline std::string library_reason(std::string_view name, std::string_view text) {
  std::string out;
  while (!text.empty()) {
    std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    if (line.starts_with(name)) line.remove_prefix(name.size());
    line.remove_prefix(std::min(line.find_first_not_of(" :"), line.size()));
    if (line.empty() || out.find(line) != std::string::npos) continue;
    out += out.empty() ? "" : " ";
    out += line;
  }
  while (!out.empty() && out.back() == '.') out.pop_back();
  return out.empty() ? "no reason is given" : out;
}

/// Throws the DataError of a picture that is damaged or of a kind that is not read.
[[noreturn]] inline void fail_to_read(std::string_view name, std::string_view text) {
  throw DataError(
      fmt::format("The image {} cannot be read ({}): copy it again if it is truncated or damaged, "
                  "or convert it to PNG or JPEG",
                  name, library_reason(name, text)));
}

}  // namespace raysplats::io
