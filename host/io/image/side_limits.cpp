// SPDX-License-Identifier: Apache-2.0
#include "io/image/side_limits.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "raysplats/error.hpp"
#include "util/path_text.hpp"

namespace raysplats::io {
namespace {

struct SideLimit {
  std::string_view extension;
  std::string_view format;
  int most;
};

// PNG has numbers for more, but libpng neither writes nor reads it, and that is what browsers read
// APNG with. GIF would be written with the number's lower 16 bits; libjpeg ends the process.
constexpr std::array<SideLimit, 6> kLimits{{{".jpg", "JPEG", 65500},
                                            {".jpeg", "JPEG", 65500},
                                            {".png", "PNG", 1000000},
                                            {".apng", "APNG", 1000000},
                                            {".gif", "GIF", 65535},
                                            {".mp4", "H.264", 16384}}};

}  // namespace

void require_writable_size(const std::filesystem::path& path, int width, int height) {
  const std::string extension = lower_extension(path);
  const auto limit = std::find_if(kLimits.begin(), kLimits.end(), [&](const SideLimit& each) {
    return each.extension == extension;
  });
  if (limit == kLimits.end() || std::max(width, height) <= limit->most) return;
  throw UsageError(fmt::format(
      "{} would have {} x {} pixels, and {} has at most {} a side: make it smaller, or use another "
      "format",
      path.string(), width, height, limit->format, limit->most));
}

}  // namespace raysplats::io
