// SPDX-License-Identifier: Apache-2.0
#include "train/target_cache.hpp"

#include <memory>
#include <utility>

#include "io/resample.hpp"

namespace raysplats {
namespace {

constexpr float kWhole = 255.0f;

// The photo at another size. Colours come from the pixels that count.
io::PackedImage reduced(const io::PackedImage& packed, int width, int height) {
  Image image(packed.width, packed.height, 4);
  Image weight(packed.weights.empty() ? 0 : packed.width,
               packed.weights.empty() ? 0 : packed.height, 4);
  for (std::size_t i = 0; i < packed.pixels.size(); ++i) {
    for (std::size_t c = 0; c < 4; ++c)
      image.data[4 * i + c] = static_cast<float>(packed.pixels[i] >> (8 * c) & 0xffu) / kWhole;
    if (packed.weights.empty()) continue;
    weight.data[4 * i + 3] = static_cast<float>(packed.weights[i]) / kWhole;
    image.data[4 * i + 3] *= weight.data[4 * i + 3];
  }
  image = io::area_resample(image, width, height);
  if (packed.weights.empty()) return io::pack(image);
  return io::pack(io::take_weight(std::move(image), io::area_resample(weight, width, height)));
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
    photo = std::make_shared<const io::PackedImage>(reduced(*photo, width, height));
  }
  std::vector<std::uint32_t> words = photo->pixels;
  words.insert(words.end(), photo->weights.begin(), photo->weights.end());
  const std::size_t bytes = words.size() * sizeof(std::uint32_t);
  const bool stays = cached_ + bytes <= budget_;
  Entry& target = stays ? entry : passing_;
  target.width = width;
  target.height = height;
  target.pixels = Buffer<std::uint32_t>(context_, words.size(), "photo");
  target.pixels.upload_later(std::move(words));
  if (stays) cached_ += bytes;
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
