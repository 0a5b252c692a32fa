// SPDX-License-Identifier: Apache-2.0
#include "train/target_cache.hpp"

#include <memory>
#include <utility>

#include "io/resample.hpp"

namespace raysplats {
namespace {

Image unpack(const io::PackedImage& packed) {
  Image image(packed.width, packed.height, 4);
  for (std::size_t i = 0; i < packed.pixels.size(); ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      image.data[4 * i + c] = static_cast<float>(packed.pixels[i] >> (8 * c) & 0xffu) / 255.0f;
    }
  }
  return image;
}

}  // namespace

TargetCache::TargetCache(Context& context,
                         std::vector<View> views,
                         std::size_t budget,
                         std::size_t host_budget)
    : context_(context),
      budget_(budget),
      entries_(views.size()),
      loader_(std::move(views), host_budget) {}

const Buffer<std::uint32_t>& TargetCache::get(std::size_t view, int width, int height) {
  Entry& entry = entries_[view];
  if (entry.width == width && entry.height == height) return entry.pixels;
  // The resolution has changed: this size is not asked for again.
  cached_ -= entry.pixels.size() * sizeof(std::uint32_t);
  entry = Entry();

  std::shared_ptr<const io::PackedImage> photo = loader_.get(view);
  if (photo->width != width || photo->height != height) {
    photo = std::make_shared<const io::PackedImage>(
        io::pack(io::area_resample(unpack(*photo), width, height)));
  }
  const bool stays = cached_ + photo->bytes() <= budget_;
  Entry& target = stays ? entry : passing_;
  target.width = width;
  target.height = height;
  target.pixels = Buffer<std::uint32_t>(context_, photo->pixels.size(), "photo");
  target.pixels.upload(photo->pixels);
  if (stays) cached_ += photo->bytes();
  return target.pixels;
}

void TargetCache::prefetch(std::span<const std::size_t> views) {
  std::vector<std::size_t> missing;
  for (const std::size_t view : views) {
    if (entries_[view].width == 0) missing.push_back(view);
  }
  if (!missing.empty()) loader_.prefetch(missing);
}

}  // namespace raysplats
