// SPDX-License-Identifier: Apache-2.0
#include "io/image/image_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "io/byte_reader.hpp"
#include "io/image/image_codec.hpp"
#include "io/image/image_header.hpp"
#include "io/image/image_integrity.hpp"
#include "io/image/image_limits.hpp"
#include "io/image/side_limits.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "util/atomic_file.hpp"
#include "util/file_kind.hpp"
#include "util/path_text.hpp"

namespace raysplats {
namespace {

/// Of the greatest integer that there is: less is no photo's brightest pixel.
constexpr float kLeastWhite = 1.0f / 256.0f;

constexpr const char* kFormats = "PNG, JPEG, EXR, HDR, TIFF, WebP, BMP, GIF, TGA, HEIF or AVIF";

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
  std::array<char, io::kPngHeaderBytes> magic{};
  std::ifstream stream(path, std::ios::binary);
  if (!stream)
    throw DataError(fmt::format("The image {} cannot be opened for reading", path.string()));
  stream.read(magic.data(), magic.size());
  if (stream.gcount() == 0) throw DataError(fmt::format("The image {} is empty", path.string()));
  const std::string_view start(magic.data(), static_cast<std::size_t>(stream.gcount()));
  std::string_view format = io::format_of(start);
  if (format.empty() && lower_extension(path) == ".tga" && io::is_targa(start)) format = "targa";
  if (format.empty()) {
    throw DataError(fmt::format("The image {} is corrupt: it does not start as a {} file",
                                path.string(), kFormats));
  }
  bool whole = true;
  if (for_pixels && (format == "png" || format == "jpeg")) {
    const std::vector<std::byte> bytes = io::read_file(path);
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    whole = format == "png" ? io::has_whole_png_chunks(text, false) : io::is_whole_jpeg(bytes);
  } else if (for_pixels && format == "tiff") {
    stream.clear();
    stream.seekg(0);
    whole = io::has_whole_jpeg_strips(stream);
  } else if (format == "png") {
    whole = io::has_whole_png_chunks(start, true);
  }
  if (!whole) fail_damaged(path.string());
  return std::string(format);
}

/// No file says what is white among integers of 32 bits or more. The codec takes the greatest that
/// there are; beside it counts, labels and numbers of a camera, of 16 bits or less, are all black.
void require_known_white(const io::RawImage& image,
                         double greatest,
                         const std::filesystem::path& path) {
  if (greatest <= UINT16_MAX) return;
  const auto channels = static_cast<std::size_t>(image.channels);
  const std::size_t colors = channels - (channels % 2 == 0 ? 1 : 0);
  const auto& numbers = std::get<std::vector<float>>(image.numbers);
  float most = 0.0f;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (i % channels < colors) most = std::max(most, numbers[i]);
  }
  if (most == 0.0f || most >= kLeastWhite) return;
  throw DataError(fmt::format(
      "The image {} has integers of more than 16 bits, of which the greatest is {:.0f}: what "
      "is white is not known, convert it to 8 or 16 bits, or to floats of 0 to 1",
      path.string(), static_cast<double>(most) * greatest));
}

/// Takes out alpha that is 0 everywhere.
void drop_unused_alpha(io::RawImage& image) {
  const auto channels = static_cast<std::size_t>(image.channels);
  if (channels % 2 != 0) return;
  std::visit(
      [&](auto& numbers) {
        std::size_t kept = 0;
        for (std::size_t i = channels - 1; i < numbers.size(); i += channels) {
          if (numbers[i] > 0) return;
        }
        for (std::size_t i = 0; i < numbers.size(); ++i) {
          if (i % channels != channels - 1) numbers[kept++] = numbers[i];
        }
        numbers.resize(kept);
        --image.channels;
      },
      image.numbers);
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
  const std::string format = checked_format(path, true);
  const auto decoder = image_codec().open(format, path.string(), {});
  RawImage image = decoder->decode();
  require_known_white(image, decoder->greatest_integer(), path);
  if (!states_alpha(path, format)) drop_unused_alpha(image);
  return image;
}

RawImage read_stored_numbers(const std::filesystem::path& path) {
  const auto decoder = image_codec().open(checked_format(path, true), path.string(), {});
  RawImage image = decoder->decode();
  if (const double greatest = decoder->greatest_integer(); greatest > 0.0) {
    for (float& number : std::get<std::vector<float>>(image.numbers))
      number = static_cast<float>(std::round(greatest * static_cast<double>(number)));
  }
  return image;
}

}  // namespace io

Image read_image(const std::filesystem::path& path) {
  return io::to_image(io::read_raw_image(path));
}

void write_image(const std::filesystem::path& path,
                 const Image& image,
                 const std::vector<std::string>& extra_channels,
                 ColorSpace space) {
  const std::string extension = lower_extension(path);
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
  io::require_writable_size(path, image.width, image.height);
  io::ImageEncoding encoding{
      exr ? "openexr" : (jpeg ? "jpeg" : "png"), {}, color_space_name(space)};
  if (exr) encoding.channel_names = exr_channel_names(image, extra_channels);
  const std::vector<unsigned char> encoded = io::image_codec().encode(path, image, encoding);
  AtomicFile file(path);
  file.write(encoded.data(), encoded.size());
  file.commit();
}

}  // namespace raysplats
