// SPDX-License-Identifier: Apache-2.0
#include "raysplats/lpips.hpp"

#include <fmt/format.h>

#include "io/image/image_codec.hpp"
#include "raysplats/error.hpp"
#include "scene/image/image_check.hpp"
#include "util/file_kind.hpp"

namespace raysplats {

struct Lpips::Impl {
  std::unique_ptr<io::PerceptualNetwork> network;
};

bool Lpips::available() { return io::image_codec().has_networks(); }

Lpips::Lpips(const std::filesystem::path& network) : impl_(std::make_unique<Impl>()) {
  if (available() && !is_file(network)) {
    throw DataError(fmt::format("The LPIPS network {} {}: give the path of an ONNX file",
                                network.string(),
                                is_folder(network) ? "is a folder" : "does not exist"));
  }
  impl_->network = io::image_codec().open_network(network);
}

double Lpips::distance(const Image& image, const Image& photo) {
  if (image.width != photo.width || image.height != photo.height || image.channels < 3 ||
      photo.channels < 3) {
    throw UsageError(fmt::format(
        "LPIPS compares RGB images of equal size; these are {}x{}x{} and {}x{}x{}", image.width,
        image.height, image.channels, photo.width, photo.height, photo.channels));
  }
  check_image(image, "The image");
  check_image(photo, "The photo");
  return impl_->network->distance(image, photo);
}

Lpips::~Lpips() = default;
Lpips::Lpips(Lpips&&) noexcept = default;
Lpips& Lpips::operator=(Lpips&&) noexcept = default;

}  // namespace raysplats
