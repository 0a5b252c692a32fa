// SPDX-License-Identifier: Apache-2.0
#include "train/loss/photo_cache.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "scene/image/pixel_count.hpp"

namespace raysplats {
namespace {

constexpr int kFloatPlanes = 4;
constexpr std::size_t kGroup = 64;

std::size_t largest_photo(const std::vector<View>& views) {
  std::size_t bytes = 0;
  for (const View& view : views) bytes = std::max(bytes, io::photo_bytes(view));
  return bytes;
}

}  // namespace

PhotoCache::PhotoCache(Context& context,
                       const std::vector<View>& views,
                       std::size_t budget,
                       std::size_t ahead)
    : context_(context),
      budget_(budget),
      entries_(views.size()),
      loader_(views, ahead * largest_photo(views)) {
  if (context.device().type != DeviceType::kCpu) uploads_.emplace(context);
}

const PhotoCache::Entry& PhotoCache::full_size(std::size_t view) {
  Entry& entry = entries_[view];
  // What was enqueued until now is all that uses the last passing photo.
  if (uploads_ && passing_used_) {
    passing_[turn_].free = uploads_->moment();
    turn_ = (turn_ + 1) % passing_.size();
  }
  passing_used_ = false;
  if (entry.width > 0) return entry;
  const std::shared_ptr<const io::Photo> photo = loader_.get(view);
  const bool stays = cached_ + photo->bytes() <= budget_;
  passing_used_ = !stays;
  Entry& target = stays ? entry : passing_[turn_].entry;
  target.words.ensure(context_, photo->words.size(), "photo");
  if (uploads_) {
    uploads_->upload(photo->words, target.words,
                     stays ? UploadQueue::Moment() : std::move(passing_[turn_].free));
  } else {
    target.words.upload_later({photo, &photo->words});
  }
  target.width = photo->width;
  target.height = photo->height;
  target.planes = photo->planes;
  target.weighted = photo->weighted;
  if (stays) {
    cached_ += photo->bytes();
    loader_.forget(view);
  }
  return target;
}

DevicePhoto PhotoCache::get(std::size_t view, int width, int height) {
  const DevicePhoto whole = get_whole(view, width, height);
  if (left_out_.empty() || left_out_[view].width == 0) return whole;
  const LeftOut& out = left_out_[view];
  const DevicePhoto rest{masked_, whole.planes, whole.weighted || cut_out_};
  const std::size_t pixels = pixel_count(width, height);
  masked_.ensure(context_, rest.words_of(pixels), "photo without what moves");
  if (!mask_) mask_ = context_.kernel("train/photo_cache.cl", "mask_photo");
  mask_.launch(Range::linear(pixels, kGroup), whole.words, out.words, masked_, whole.planes,
               whole.weighted ? 1 : 0, rest.weighted ? 1 : 0, width, height, out.width, out.height);
  return rest;
}

void PhotoCache::leave_out(std::size_t view, const PixelMask& mask, bool cut_out) {
  left_out_.resize(entries_.size());
  cut_out_ = cut_out;
  LeftOut& out = left_out_[view];
  out.width = mask.width;
  out.height = mask.height;
  if (mask.width == 0) return;
  out.words.ensure(context_, mask.words.size(), "what moves in a photo");
  out.words.upload(mask.words);
}

DevicePhoto PhotoCache::get_whole(std::size_t view, int width, int height) {
  const Entry& entry = full_size(view);
  const DevicePhoto whole{entry.words, entry.planes, entry.weighted};
  if (entry.width == width && entry.height == height) return whole;
  const DevicePhoto small{reduced_, kFloatPlanes, entry.weighted};
  const std::size_t pixels = pixel_count(width, height);
  reduced_.ensure(context_, small.words_of(pixels), "reduced photo");
  if (!reduce_) reduce_ = context_.kernel("train/photo_cache.cl", "reduce_photo");
  reduce_.launch(Range::linear(pixels, kGroup), entry.words, reduced_, entry.planes,
                 entry.weighted ? 1 : 0, entry.width, entry.height, width, height);
  return small;
}

void PhotoCache::prefetch(std::span<const std::size_t> views) {
  std::vector<std::size_t> missing;
  for (const std::size_t view : views) {
    if (entries_[view].width == 0) missing.push_back(view);
  }
  if (!missing.empty()) loader_.prefetch(missing);
}

}  // namespace raysplats
