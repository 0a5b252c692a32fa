// SPDX-License-Identifier: Apache-2.0
#include "view/photos.hpp"

#include <algorithm>

#include "io/image/image_codec.hpp"

namespace raysplats::view {
namespace {

constexpr std::size_t kKept = 8;
constexpr int kQuality = 92;

}  // namespace

Photos::Photos(std::vector<View> views, const std::array<float, 3>& background)
    : views_(std::move(views)), background_(background) {}

std::optional<std::string> Photos::jpeg(std::size_t index) {
  if (index >= views_.size()) return std::nullopt;
  const auto known = std::find_if(kept_.begin(), kept_.end(),
                                  [&](const auto& entry) { return entry.first == index; });
  if (known != kept_.end()) return known->second;
  View view = views_[index];
  const int side = std::max(view.camera.width, view.camera.height);
  if (side > kPhotoSide)
    view.camera = downscaled(view.camera, static_cast<double>(side) / kPhotoSide);
  io::ImageEncoding encoding;
  encoding.format = "jpeg";
  encoding.quality = kQuality;
  const std::vector<unsigned char> bytes = io::image_codec().encode(
      "photo.jpg", composite(load_view_image(view), background_.data()), encoding);
  kept_.emplace_front(index, std::string(bytes.begin(), bytes.end()));
  if (kept_.size() > kKept) kept_.pop_back();
  return kept_.front().second;
}

}  // namespace raysplats::view
