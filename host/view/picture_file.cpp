// SPDX-License-Identifier: Apache-2.0
#include "view/picture_file.hpp"

#include <algorithm>
#include <bit>

#include "io/image/image_codec.hpp"

namespace raysplats::view {
namespace {

constexpr std::uint32_t kMagic = 0x46565352;  // "RSVF"
constexpr std::uint32_t kLast = 1;
constexpr std::uint32_t kPng = 2;

void put(std::vector<std::byte>& to, std::uint32_t value) {
  for (int i = 0; i < 4; ++i, value >>= 8) to.push_back(static_cast<std::byte>(value & 0xff));
}

Image without_alpha(const Image& rgba) {
  Image out(rgba.width, rgba.height, 3);
  for (std::size_t i = 0; i < rgba.pixels(); ++i)
    std::copy_n(&rgba.data[4 * i], 3, &out.data[3 * i]);
  return out;
}

}  // namespace

std::vector<std::byte> picture_message(const PictureHeader& header,
                                       const Image& rgba,
                                       int quality) {
  io::ImageEncoding encoding;
  encoding.format = header.png ? "png" : "jpeg";
  encoding.quality = quality;
  const std::vector<unsigned char> encoded = io::image_codec().encode(
      header.png ? "picture.png" : "picture.jpg", without_alpha(rgba), encoding);
  std::vector<std::byte> message;
  message.reserve(kPictureHeader + encoded.size());
  put(message, kMagic);
  put(message, header.view);
  put(message, static_cast<std::uint32_t>(rgba.width));
  put(message, static_cast<std::uint32_t>(rgba.height));
  put(message, header.samples);
  put(message, (header.last ? kLast : 0u) | (header.png ? kPng : 0u));
  put(message, static_cast<std::uint32_t>(header.iteration));
  put(message, std::bit_cast<std::uint32_t>(header.milliseconds));
  for (const unsigned char byte : encoded) message.push_back(std::byte{byte});
  return message;
}

}  // namespace raysplats::view
