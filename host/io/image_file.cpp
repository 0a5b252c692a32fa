// SPDX-License-Identifier: Apache-2.0
#include "io/image_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "io/byte_reader.hpp"
#include "io/image_codec.hpp"
#include "io/image_header.hpp"
#include "io/image_limits.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "util/atomic_file.hpp"
#include "util/file_kind.hpp"

namespace raysplats {
namespace {

constexpr std::string_view kPngStart = "\x89PNG\r\n\x1a\n";
constexpr const char* kFormats = "PNG, JPEG, EXR, HDR, TIFF, WebP, BMP, GIF, TGA, HEIF or AVIF";

/// The file type box of ISO base media (ISO/IEC 14496-12, 4.3), with a brand of still pictures
/// (ISO/IEC 23008-12; AVIF): videos begin alike.
bool is_heif(std::string_view magic) {
  if (magic.size() < 12 || magic.substr(4, 4) != "ftyp") return false;
  static constexpr std::array<std::string_view, 9> kBrands{"heic", "heix", "heim", "heis", "mif1",
                                                           "msf1", "avif", "avis", "miaf"};
  return std::find(kBrands.begin(), kBrands.end(), magic.substr(8, 4)) != kBrands.end();
}

/// TGA has no magic number: whether these can be the kinds of palette and picture, and the bits of
/// a pixel, of its header (Truevision, version 2.0).
bool is_targa(std::string_view start) {
  if (start.size() < 18) return false;
  const auto byte_at = [&](std::size_t i) { return static_cast<std::uint8_t>(start[i]); };
  const unsigned kind = byte_at(2), bits = byte_at(16);
  const bool known = (kind >= 1 && kind <= 3) || (kind >= 9 && kind <= 11);
  return known && byte_at(1) <= 1 &&
         (bits == 8 || bits == 15 || bits == 16 || bits == 24 || bits == 32);
}

/// OpenImageIO's name of the format that the first bytes belong to; "" for any other.
std::string_view format_of(std::string_view magic) {
  if (magic.starts_with(kPngStart)) return "png";
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

/// The end-of-image marker ends every whole JPEG. The decoder fills the rest of a truncated one
/// with grey instead of failing, so the segments are walked here (ITU-T T.81, annex B).
bool is_whole_jpeg(std::span<const std::byte> bytes) {
  const auto byte_at = [&](std::size_t i) { return std::to_integer<unsigned>(bytes[i]); };
  std::size_t i = 2;
  while (i + 1 < bytes.size()) {
    if (byte_at(i) != 0xff) {
      ++i;  // entropy-coded data
      continue;
    }
    const unsigned marker = byte_at(i + 1);
    if (marker == 0xd9) return true;
    if (marker == 0xff) {
      ++i;  // fill byte
    } else if (marker == 0x00 || marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8)) {
      i += 2;  // stuffed byte or a marker without a segment
    } else {
      if (i + 3 >= bytes.size()) return false;
      i += 2 + (byte_at(i + 2) << 8 | byte_at(i + 3));
    }
  }
  return false;
}

/// Signature and header chunk.
constexpr std::size_t kPngHeaderBytes = 33;

constexpr std::array<std::uint32_t, 256> crc_table() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < table.size(); ++i) {
    std::uint32_t value = i;
    for (int bit = 0; bit < 8; ++bit) value = (value >> 1) ^ ((value & 1u) != 0 ? 0xedb88320u : 0u);
    table[i] = value;
  }
  return table;
}

/// Whether the chunks of a PNG are whole, with their checksums (PNG specification, section 5), up
/// to the end chunk or, with `header_only`, the header chunk. libpng would print a line of its own
/// for what this finds.
bool has_whole_png_chunks(std::string_view bytes, bool header_only) {
  static constexpr std::array<std::uint32_t, 256> kTable = crc_table();
  const auto big_endian = [&](std::size_t i) {
    std::uint32_t value = 0;
    for (std::size_t k = 0; k < 4; ++k)
      value = value << 8 | static_cast<std::uint8_t>(bytes[i + k]);
    return value;
  };
  std::size_t i = kPngStart.size();
  constexpr std::size_t kAroundData = 12;  // length, type and checksum
  while (bytes.size() - i >= kAroundData) {
    const std::size_t length = big_endian(i);
    if (length > bytes.size() - i - kAroundData) return false;
    const std::string_view checked = bytes.substr(i + 4, length + 4);
    std::uint32_t crc = 0xffffffffu;
    for (const char c : checked)
      crc = kTable[(crc ^ static_cast<std::uint8_t>(c)) & 0xffu] ^ (crc >> 8);
    if ((crc ^ 0xffffffffu) != big_endian(i + 8 + length)) return false;
    if (header_only) return checked.starts_with("IHDR");
    if (checked.starts_with("IEND")) return true;
    i += length + kAroundData;
  }
  return false;
}

[[noreturn]] void fail_damaged(const std::string& name) {
  throw DataError(fmt::format("The image {} is truncated or damaged: copy it again", name));
}

/// OpenImageIO's name of an image file's format; throws DataError for what is none. `for_pixels`:
/// checks that the file is whole.
std::string checked_format(const std::filesystem::path& path, bool for_pixels) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    throw DataError(
        fmt::format("The image {} {}", path.string(),
                    std::filesystem::exists(path, error) ? "is not a file" : "does not exist"));
  }
  if (!io::has_image_extension(path)) {
    throw DataError(fmt::format("The image {} has an unknown extension: it must be {}",
                                path.string(), kFormats));
  }
  std::array<char, kPngHeaderBytes> magic{};
  std::ifstream stream(path, std::ios::binary);
  if (!stream)
    throw DataError(fmt::format("The image {} cannot be opened for reading", path.string()));
  stream.read(magic.data(), magic.size());
  if (stream.gcount() == 0) throw DataError(fmt::format("The image {} is empty", path.string()));
  const std::string_view start(magic.data(), static_cast<std::size_t>(stream.gcount()));
  std::string_view format = format_of(start);
  if (format.empty() && io::lower_extension(path) == ".tga" && is_targa(start)) format = "targa";
  if (format.empty()) {
    throw DataError(fmt::format("The image {} is corrupt: it does not start as a {} file",
                                path.string(), kFormats));
  }
  bool whole = true;
  if (for_pixels && (format == "png" || format == "jpeg")) {
    const std::vector<std::byte> bytes = io::read_file(path);
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    whole = format == "png" ? has_whole_png_chunks(text, false) : is_whole_jpeg(bytes);
  } else if (format == "png") {
    whole = has_whole_png_chunks(start, true);
  }
  if (!whole) fail_damaged(path.string());
  return std::string(format);
}

std::vector<std::string> exr_channel_names(const Image& image,
                                           const std::vector<std::string>& extra) {
  static const std::array<std::vector<std::string>, 5> kNames{
      {{}, {"Y"}, {"Y", "A"}, {"R", "G", "B"}, {"R", "G", "B", "A"}}};
  const int base = image.channels - static_cast<int>(extra.size());
  if (base < 1 || base > 4) return {};
  std::vector<std::string> names = kNames[static_cast<std::size_t>(base)];
  names.insert(names.end(), extra.begin(), extra.end());
  return names;
}

/// OpenImageIO's names, which it has had longest.
std::string color_space_name(ColorSpace space) {
  if (space == ColorSpace::kLinear) return "Linear";
  return space == ColorSpace::kDisplay ? "sRGB" : "";
}

}  // namespace

namespace io {

std::string lower_extension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return extension;
}

std::filesystem::path portable_path(std::string text) {
  std::replace(text.begin(), text.end(), '\\', '/');
  return text;
}

bool has_image_extension(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  return std::find(kImageExtensions.begin(), kImageExtensions.end(), extension) !=
         kImageExtensions.end();
}

bool is_photo_name(const std::filesystem::path& path) {
  return has_image_extension(path) && !is_apple_double(path);
}

ImageSize image_size(const std::filesystem::path& path) {
  const std::string format = checked_format(path, false);
  if (const auto size = size_in_header(path, format)) {
    require_bearable_size(path.string(), size->width, size->height);
    return *size;
  }
  const auto input = image_codec().open(format, path.string(), {});
  // These have 8 bits by definition, whatever the codec makes of them.
  const bool bytes = format == "webp" || format == "bmp";
  return {input->width(), input->height(), bytes ? 1 : input->sample_bytes()};
}

int image_orientation(const std::filesystem::path& path) {
  return image_codec().open(checked_format(path, false), path.string(), {})->orientation();
}

std::string color_profile(const std::filesystem::path& path) {
  const std::string format = checked_format(path, false);
  if (!may_have_profile(path, format)) return {};
  return image_codec().open(format, path.string(), {})->color_profile();
}

Image decode_image(std::span<const std::byte> bytes, const std::string& name) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::string_view format = format_of(text);
  if (format != "png" && format != "jpeg") {
    throw DataError(fmt::format("The image {} is neither a PNG nor a JPEG file", name));
  }
  if (format == "png" ? !has_whole_png_chunks(text, false) : !is_whole_jpeg(bytes)) {
    fail_damaged(name);
  }
  return to_image(image_codec().open(std::string(format), name, bytes)->decode());
}

RawImage read_raw_image(const std::filesystem::path& path) {
  return image_codec().open(checked_format(path, true), path.string(), {})->decode();
}

}  // namespace io

Image read_image(const std::filesystem::path& path) {
  return io::to_image(io::read_raw_image(path));
}

void write_image(const std::filesystem::path& path,
                 const Image& image,
                 const std::vector<std::string>& extra_channels,
                 ColorSpace space) {
  const std::string extension = io::lower_extension(path);
  const bool jpeg = extension == ".jpg" || extension == ".jpeg";
  const bool exr = extension == ".exr";
  if (!jpeg && !exr && extension != ".png") {
    throw DataError(fmt::format(
        "The image {} cannot be written: its extension must be .png, .jpg or .exr", path.string()));
  }
  const int extra = static_cast<int>(extra_channels.size());
  if (image.width < 1 || image.height < 1 || image.channels < 1 || image.channels - extra < 1 ||
      image.channels - extra > 4 || (extra > 0 && !exr) ||
      image.data.size() != image.pixels() * static_cast<std::size_t>(image.channels)) {
    throw DataError(
        fmt::format("The image {} cannot be written: {} x {} pixels with {} channels ({} of them "
                    "named) do not fit the format",
                    path.string(), image.width, image.height, image.channels, extra));
  }
  io::ImageEncoding encoding{
      exr ? "openexr" : (jpeg ? "jpeg" : "png"), {}, color_space_name(space)};
  if (exr) encoding.channel_names = exr_channel_names(image, extra_channels);
  const std::vector<unsigned char> encoded = io::image_codec().encode(path, image, encoding);
  AtomicFile file(path);
  file.write(encoded.data(), encoded.size());
  file.commit();
}

}  // namespace raysplats
