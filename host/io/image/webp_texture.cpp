// SPDX-License-Identifier: Apache-2.0
#include "io/image/webp_texture.hpp"

#include <fmt/format.h>
#include <webp/decode.h>
#include <webp/encode.h>

#include <new>

#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

constexpr int kLossless = 2;  // of WebPBitstreamFeatures
/// Effort of the encoder, 0 to 9: beyond it time doubles for a percent.
constexpr int kEffort = 6;

const std::uint8_t* webp_pointer(std::span<const std::byte> bytes) {
  return reinterpret_cast<const std::uint8_t*>(bytes.data());
}

}  // namespace

Texture texture_size(std::span<const std::byte> bytes, TexelRange range, const std::string& name) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(webp_pointer(bytes), bytes.size(), &features) != VP8_STATUS_OK)
    throw DataError(fmt::format("{} is no WebP picture, or is damaged", name));
  if (features.format != kLossless || features.has_animation != 0)
    throw DataError(fmt::format("{} is no single lossless WebP picture", name));
  Texture texture{
      static_cast<std::size_t>(features.width), static_cast<std::size_t>(features.height), {}};
  if (texture.texels() < range.least || texture.texels() > range.most) {
    throw DataError(fmt::format("{} has {} x {} texels where {} to {} are needed", name,
                                texture.width, texture.height, range.least, range.most));
  }
  return texture;
}

Texture decode_texture(std::span<const std::byte> bytes,
                       TexelRange range,
                       const std::string& name) {
  Texture texture = texture_size(bytes, range, name);
  texture.rgba.resize(4 * texture.texels());
  if (WebPDecodeRGBAInto(webp_pointer(bytes), bytes.size(), texture.rgba.data(),
                         texture.rgba.size(), static_cast<int>(4 * texture.width)) == nullptr) {
    throw DataError(fmt::format("{} is damaged", name));
  }
  return texture;
}

std::vector<std::byte> encode_texture(const Texture& texture) {
  WebPConfig config;
  WebPPicture picture;
  WebPMemoryWriter writer;
  if (WebPConfigInit(&config) == 0 || WebPConfigLosslessPreset(&config, kEffort) == 0 ||
      WebPPictureInit(&picture) == 0) {
    throw Error(ErrorCode::kRuntime, "The version of libwebp is not the one that was built with");
  }
  config.exact = 1;
  picture.use_argb = 1;
  picture.width = static_cast<int>(texture.width);
  picture.height = static_cast<int>(texture.height);
  WebPMemoryWriterInit(&writer);
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &writer;
  const bool done = WebPPictureImportRGBA(&picture, texture.rgba.data(), 4 * picture.width) != 0 &&
                    WebPEncode(&config, &picture) != 0;
  std::vector<std::byte> out;
  if (done) {
    const auto* bytes = reinterpret_cast<const std::byte*>(writer.mem);
    out.assign(bytes, bytes + writer.size);
  }
  WebPPictureFree(&picture);
  WebPMemoryWriterClear(&writer);
  if (!done) throw std::bad_alloc();  // all else has been checked
  return out;
}

}  // namespace raysplats::io
