// SPDX-License-Identifier: Apache-2.0
#include "io/image/image_header.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <istream>
#include <string>
#include <string_view>

namespace raysplats::io {
namespace {

// The file type box of ISO base media (ISO/IEC 14496-12, 4.3), with a brand of still pictures
// (ISO/IEC 23008-12; AVIF): videos begin alike.
bool is_heif(std::string_view magic) {
  if (magic.size() < 12 || magic.substr(4, 4) != "ftyp") return false;
  static constexpr std::array<std::string_view, 9> kBrands{"heic", "heix", "heim", "heis", "mif1",
                                                           "msf1", "avif", "avis", "miaf"};
  return std::find(kBrands.begin(), kBrands.end(), magic.substr(8, 4)) != kBrands.end();
}

// A number of `count` bytes, the most significant first; nothing at the end of the file.
std::optional<unsigned> big_endian(std::istream& stream, int count) {
  unsigned value = 0;
  for (int i = 0; i < count; ++i) {
    const int byte = stream.get();
    if (byte < 0) return std::nullopt;
    value = value << 8 | static_cast<unsigned>(byte);
  }
  return value;
}

std::optional<ImageSize> size_of(std::optional<unsigned> width,
                                 std::optional<unsigned> height,
                                 int sample_bytes) {
  constexpr unsigned kMost = 0x7fffffffu;
  if (!width || !height || *width < 1 || *height < 1 || *width > kMost || *height > kMost)
    return std::nullopt;
  return ImageSize{static_cast<int>(*width), static_cast<int>(*height), sample_bytes};
}

// The first chunk is IHDR, which begins with both and the bits of a number (PNG specification,
// section 11.2.2).
std::optional<ImageSize> png_size(std::istream& stream) {
  stream.seekg(16);
  const auto width = big_endian(stream, 4);
  const auto height = big_endian(stream, 4);
  return size_of(width, height, stream.get() == 16 ? 2 : 1);
}

// Calls `take` with the marker and the length of every segment before the picture, the stream being
// at its content, until it returns true (ITU-T T.81, B.1.1.4).
template <class Take>
void walk_jpeg(std::istream& stream, const Take& take) {
  stream.seekg(2);
  for (;;) {
    if (stream.get() != 0xff) return;
    int marker = 0xff;
    while (marker == 0xff) marker = stream.get();  // fill bytes
    const bool bare = marker <= 0x01 || (marker >= 0xd0 && marker <= 0xda);
    if (bare) return;  // the picture begins, or the file ends
    const auto length = big_endian(stream, 2);
    if (!length || *length < 2) return;
    const auto content = stream.tellg();
    if (take(marker, *length - 2)) return;
    stream.clear();
    stream.seekg(content + static_cast<std::streamoff>(*length - 2));
  }
}

// The segment that begins the frame has both (ITU-T T.81, B.2.2); a height of 0 comes later.
std::optional<ImageSize> jpeg_size(std::istream& stream) {
  std::optional<ImageSize> size;
  walk_jpeg(stream, [&](int marker, unsigned) {
    const bool frame =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (!frame) return false;
    stream.get();  // bits per sample
    const auto height = big_endian(stream, 2);
    size = size_of(big_endian(stream, 2), height, 1);
    return true;
  });
  return size;
}

std::string text(std::istream& stream, std::size_t letters) {
  std::string out(letters, '\0');
  stream.read(out.data(), static_cast<std::streamsize>(letters));
  return out;
}

// Application segments 2 of that name (ICC.1, B.4).
bool jpeg_has_profile(std::istream& stream) {
  constexpr int kApplication2 = 0xe2;
  constexpr std::string_view kName = "ICC_PROFILE";
  bool found = false;
  walk_jpeg(stream, [&](int marker, unsigned) {
    found = marker == kApplication2 && text(stream, kName.size()) == kName;
    return found;
  });
  return found;
}

// Calls `take` with the type of every chunk before the picture's, the stream being at its content,
// until it returns true (PNG specification, section 5.3).
template <class Take>
void walk_png(std::istream& stream, const Take& take) {
  stream.seekg(8);
  while (const auto length = big_endian(stream, 4)) {
    const std::string type = text(stream, 4);
    if (type == "IDAT") return;
    const auto content = stream.tellg();
    if (take(type)) return;
    stream.seekg(content + (std::streamoff{*length} + 4));
  }
}

// PNG specification, section 11.3.2.3.
bool png_has_profile(std::istream& stream) {
  bool found = false;
  walk_png(stream, [&](const std::string& type) {
    found = type == "iCCP";
    return found;
  });
  return found;
}

}  // namespace

std::string_view format_of(std::string_view magic) {
  if (magic.starts_with("\x89PNG\r\n\x1a\n")) return "png";
  if (magic.starts_with("\xff\xd8\xff")) return "jpeg";
  if (magic.starts_with("\x76\x2f\x31\x01")) return "openexr";
  if (magic.starts_with("BM")) return "bmp";
  if (magic.starts_with("GIF8")) return "gif";
  if (is_heif(magic)) return "heif";
  if (magic.starts_with("#?RADIANCE") || magic.starts_with("#?RGBE")) return "hdr";
  if (magic.starts_with("RIFF") &&
      magic.substr(std::min<std::size_t>(8, magic.size())).starts_with("WEBP"))
    return "webp";
  const std::array<std::string_view, 4> tiff{
      std::string_view("II*\0", 4), std::string_view("MM\0*", 4), std::string_view("II+\0", 4),
      std::string_view("MM\0+", 4)};
  for (const std::string_view start : tiff) {
    if (magic.starts_with(start)) return "tiff";
  }
  return "";
}

bool is_targa(std::string_view start) {
  if (start.size() < 18) return false;
  const auto byte_at = [&](std::size_t i) { return static_cast<std::uint8_t>(start[i]); };
  const unsigned kind = byte_at(2), bits = byte_at(16);
  const bool known = (kind >= 1 && kind <= 3) || (kind >= 9 && kind <= 11);
  return known && byte_at(1) <= 1 &&
         (bits == 8 || bits == 15 || bits == 16 || bits == 24 || bits == 32);
}

std::optional<ImageSize> size_in_header(const std::filesystem::path& path,
                                        std::string_view format) {
  std::ifstream stream(path, std::ios::binary);
  if (format == "png") return png_size(stream);
  if (format == "jpeg") return jpeg_size(stream);
  return std::nullopt;
}

bool may_have_profile(const std::filesystem::path& path, std::string_view format) {
  std::ifstream stream(path, std::ios::binary);
  if (format == "png") return png_has_profile(stream);
  if (format == "jpeg") return jpeg_has_profile(stream);
  return true;
}

bool may_be_transparent(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  const std::string magic = text(stream, 12);
  const std::string_view format = format_of(magic);
  if (format == "jpeg" || format == "hdr") return false;
  if (format != "png") return true;
  constexpr int kAlpha = 4;  // a bit of the colour type (PNG specification, section 11.2.2)
  stream.seekg(25);
  bool found = (stream.get() & kAlpha) != 0;
  walk_png(stream, [&](const std::string& type) {
    found = found || type == "tRNS";
    return found;
  });
  return found;
}

bool states_alpha(const std::filesystem::path& path, std::string_view format) {
  std::ifstream stream(path, std::ios::binary);
  if (format == "targa") {
    stream.seekg(17);
    return (stream.get() & 15) != 0;
  }
  if (format != "bmp") return true;
  // BITMAPINFOHEADER is shorter than those with a mask of alpha.
  constexpr int kLeastBytes = 56;
  stream.seekg(14);
  if (stream.get() < kLeastBytes) return false;
  stream.seekg(66);
  return big_endian(stream, 4).value_or(0) != 0;
}

std::optional<double> png_gamma(const std::filesystem::path& path) {
  constexpr double kUnits = 100000;  // PNG specification, section 11.3.2.2
  std::ifstream stream(path, std::ios::binary);
  if (format_of(text(stream, 8)) != "png") return std::nullopt;
  std::optional<unsigned> gamma;
  bool overruled = false;
  walk_png(stream, [&](const std::string& type) {
    if (type == "gAMA") gamma = big_endian(stream, 4);
    overruled = type == "iCCP" || type == "sRGB" || type == "cICP";
    return overruled;
  });
  if (overruled || gamma.value_or(0) == 0) return std::nullopt;
  return *gamma / kUnits;
}

}  // namespace raysplats::io
