// SPDX-License-Identifier: Apache-2.0
#include "eval/kept_pictures.hpp"

namespace raysplats {

std::shared_ptr<const ViewPicture> KeptPictures::get(std::size_t number, const View& view) {
  const auto known = pictures_.find(number);
  if (known != pictures_.end()) return known->second;
  auto picture = std::make_shared<const ViewPicture>(load_view_picture(view));
  const std::size_t bytes =
      sizeof(float) * (picture->rgba.data.size() + picture->weight.data.size());
  if (kept_ + bytes > budget_) return picture;
  kept_ += bytes;
  pictures_.emplace(number, picture);
  return picture;
}

}  // namespace raysplats
