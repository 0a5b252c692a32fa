// SPDX-License-Identifier: Apache-2.0
#include "io/image/image_codec.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <cstdlib>
#include <string_view>
#include <utility>

#include "io/image/images_interface.hpp"
#include "raysplats/error.hpp"
#include "util/memory_limit.hpp"

namespace raysplats::io {

Image to_image(RawImage raw) {
  Image image;
  image.width = raw.width;
  image.height = raw.height;
  image.channels = raw.channels;
  if (auto* floats = std::get_if<std::vector<float>>(&raw.numbers)) {
    image.data = std::move(*floats);
    return image;
  }
  const auto convert = [&image](const auto& numbers, float most) {
    image.data.reserve(numbers.size());
    for (const auto number : numbers) image.data.push_back(static_cast<float>(number) / most);
  };
  if (const auto* shorts = std::get_if<std::vector<std::uint16_t>>(&raw.numbers)) {
    convert(*shorts, 65535.0f);
  } else {
    convert(std::get<std::vector<std::uint8_t>>(raw.numbers), 255.0f);
  }
  return image;
}

#ifdef RAYSPLATS_IMAGES_STATIC

const ImageCodec& image_codec() { return *raysplats_images_codec(); }

#else

namespace {

constexpr const char* kLibrary = "libraysplats-images.so";

[[noreturn]] void fail(const std::string& what) {
  throw Error(ErrorCode::kRuntime,
              fmt::format("Pictures cannot be read or written: {}{}; set RAYSPLATS_IMAGES to the "
                          "path of the {} that was built with this program, version {}",
                          what, memory_limit_remark(), kLibrary, RAYSPLATS_VERSION));
}

// Found along the run path of the program, as any library of it; it stays loaded to the end.
const ImageCodec* load() {
  const char* chosen = std::getenv("RAYSPLATS_IMAGES");
  const char* name = chosen != nullptr ? chosen : kLibrary;
  void* library = ::dlopen(name, RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) fail(::dlerror());
  const auto version = reinterpret_cast<decltype(&raysplats_images_version)>(
      ::dlsym(library, "raysplats_images_version"));
  const auto interface = reinterpret_cast<decltype(&raysplats_images_interface)>(
      ::dlsym(library, "raysplats_images_interface"));
  const auto codec = reinterpret_cast<decltype(&raysplats_images_codec)>(
      ::dlsym(library, "raysplats_images_codec"));
  if (version == nullptr || codec == nullptr) {
    fail(fmt::format("{} is not the library of this program", name));
  }
  if (std::string_view(version()) != RAYSPLATS_VERSION) {
    fail(fmt::format("{} is of version {}", name, version()));
  }
  if (interface == nullptr || interface() != kImagesInterface) {
    fail(fmt::format("{} has another interface than this program", name));
  }
  return codec();
}

}  // namespace

const ImageCodec& image_codec() {
  static const ImageCodec* const codec = load();
  return *codec;
}

#endif

}  // namespace raysplats::io
