// SPDX-License-Identifier: Apache-2.0
#include "train/loss/depth_cache.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>

#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"
#include "util/parallel.hpp"

namespace raysplats {
namespace {

std::size_t map_bytes(int width, int height) { return pixel_count(width, height) * sizeof(float); }

bool has_size(const DeviceDepths& depths, const SizedView& wanted) {
  return depths.width == wanted.width && depths.height == wanted.height;
}

// The one of `targets` pixels along an axis whose area a pixel of `sources` lies in.
std::uint64_t place_of(std::uint64_t source, int sources, int targets) {
  return ((source + 1) * static_cast<std::uint64_t>(targets) - 1) /
         static_cast<std::uint64_t>(sources);
}

std::vector<DepthPoint> listed(const io::DepthMap& map) {
  std::vector<DepthPoint> out;
  for (std::size_t i = 0; i < map.values.size(); ++i) {
    if (map.values[i] > 0) out.push_back({static_cast<std::uint32_t>(i), map.values[i]});
  }
  return out;
}

}  // namespace

std::vector<DepthPoint> reduced(
    std::span<const DepthPoint> points, int width, int height, int to_width, int to_height) {
  std::vector<DepthPoint> all;
  all.reserve(points.size());
  for (const DepthPoint& point : points) {
    const auto row_length = static_cast<std::uint64_t>(width);
    const std::uint64_t x = place_of(point.pixel % row_length, width, to_width);
    const std::uint64_t y = place_of(point.pixel / row_length, height, to_height);
    all.push_back(
        {static_cast<std::uint32_t>(y * static_cast<std::uint64_t>(to_width) + x), point.depth});
  }
  std::sort(all.begin(), all.end(), [](const DepthPoint& a, const DepthPoint& b) {
    return std::pair(a.pixel, a.depth) < std::pair(b.pixel, b.depth);
  });
  std::vector<DepthPoint> out;
  for (std::size_t begin = 0, end = 0; begin < all.size(); begin = end) {
    while (end < all.size() && all[end].pixel == all[begin].pixel) ++end;
    out.push_back(all[begin + (end - begin) / 2]);
  }
  return out;
}

std::size_t depth_map_bytes(const Dataset& dataset, std::span<const std::size_t> views) {
  std::size_t bytes = 0;
  for (const std::size_t index : views) {
    const View& view = dataset.views[index];
    if (!view.depth_path.empty()) bytes += map_bytes(view.camera.width, view.camera.height);
  }
  return bytes;
}

DepthCache::DepthCache(Context& context,
                       const Dataset& dataset,
                       std::span<const std::size_t> views,
                       double unit,
                       std::size_t budget)
    : context_(context), unit_(unit), budget_(budget), entries_(views.size()) {
  std::vector<std::uint8_t> empty(views.size());  // maps that know nothing
  in_parallel(views.size(), [&](std::size_t i) {
    const View& view = dataset.views[views[i]];
    Entry& entry = entries_[i];
    entry.source = view;
    entry.source.points.clear();
    if (view.depth_path.empty()) {
      entry.points = listed(io::view_depths(dataset, view, unit));
    } else {
      empty[i] = io::check_depth_map(view, unit) ? 0 : 1;
    }
  });
  std::size_t empty_maps = 0;
  std::string first_empty;
  for (std::size_t i = 0; i < views.size(); ++i) {
    std::filesystem::path& map = entries_[i].source.depth_path;
    if (empty[i] != 0) {
      if (empty_maps++ == 0) first_empty = map.string();
      map.clear();
    } else if (!map.empty()) {
      ++with_maps_;
    } else if (!dataset.views[views[i]].points.empty()) {
      ++with_points_;
    }
  }
  if (empty_maps == 0) return;
  if (with_maps_ + with_points_ == 0) {
    throw DataError(fmt::format(
        "No depth map has a number above 0, {} as little as the others: give maps that know "
        "depths, or leave out 'depth-weight'",
        first_empty));
  }
  spdlog::warn(
      "{} of {} depth maps have no number above 0, {} among them: nothing is known of the depths "
      "of their photos",
      empty_maps, empty_maps + with_maps_, first_empty);
}

// What is on the device of a view at that size; null if nothing is.
const DeviceDepths* DepthCache::held(const SizedView& wanted) const {
  const DeviceDepths& resident = entries_[wanted.view].resident;
  if (has_size(resident, wanted)) return &resident;
  return passing_view_ == wanted.view && has_size(passing_, wanted) ? &passing_ : nullptr;
}

// On a thread of its own where it was foreseen: a lens is taken out, and a large map reduced, in
// tenths of a second.
DepthCache::SizedMap DepthCache::load(const SizedView& wanted) const {
  io::DepthMap map = io::view_depths({}, entries_[wanted.view].source, unit_, true);
  if (map.width != wanted.width || map.height != wanted.height)
    map = io::reduced(map, wanted.width, wanted.height);
  const std::size_t known = io::count_known(map);
  return {std::make_shared<const std::vector<float>>(std::move(map.values)), known};
}

DepthCache::SizedMap DepthCache::take(const SizedView& wanted) {
  const auto found = coming_.find(wanted.view);
  if (found == coming_.end() || found->second.wanted != wanted) return load(wanted);
  std::future<SizedMap> map = std::move(found->second.map);
  coming_.erase(found);
  return map.get();
}

void DepthCache::upload_points(Entry& entry, int width, int height) {
  const Camera& camera = entry.source.camera;
  const std::vector<DepthPoint> points =
      reduced(entry.points, camera.width, camera.height, width, height);
  auto pixels = std::make_shared<std::vector<std::uint32_t>>();
  auto depths = std::make_shared<std::vector<float>>();
  for (const DepthPoint& point : points) {
    pixels->push_back(point.pixel);
    depths->push_back(point.depth);
  }
  DeviceDepths& out = entry.resident;
  out = {width, height, points.size(), true, {}, {}};
  if (points.empty()) return;
  out.pixels = Buffer<std::uint32_t>(context_, points.size(), "pixels of known depth");
  out.depths = Buffer<float>(context_, points.size(), "known depths");
  out.pixels.upload_later(pixels);
  out.depths.upload_later(depths);
}

const DeviceDepths& DepthCache::get(const SizedView& wanted) {
  if (const DeviceDepths* found = held(wanted)) return *found;
  Entry& entry = entries_[wanted.view];
  if (entry.source.depth_path.empty()) {
    upload_points(entry, wanted.width, wanted.height);
    return entry.resident;
  }
  const SizedMap map = take(wanted);
  cached_ -= map_bytes(entry.resident.width, entry.resident.height);
  entry.resident = {};
  const std::size_t bytes = map_bytes(wanted.width, wanted.height);
  const bool stays = cached_ + bytes <= budget_;
  DeviceDepths& target = stays ? entry.resident : passing_;
  target.width = target.height = 0;  // holds nothing until it is there
  target.depths.ensure(context_, map.values->size(), "known depths");
  target.depths.upload_later(map.values);
  target.width = wanted.width;
  target.height = wanted.height;
  target.known = map.known;
  if (stays) {
    cached_ += bytes;
  } else {
    passing_view_ = wanted.view;
  }
  return target;
}

void DepthCache::prefetch(std::span<const SizedView> wanted) {
  std::map<std::size_t, Coming> coming;
  for (const SizedView& one : wanted) {
    if (entries_[one.view].source.depth_path.empty() || held(one) != nullptr) continue;
    if (coming.contains(one.view)) continue;
    const auto found = coming_.find(one.view);
    if (found != coming_.end() && found->second.wanted == one) {
      coming.insert(coming_.extract(found));
    } else {
      coming[one.view] = {one, std::async(std::launch::async, [this, one] { return load(one); })};
    }
  }
  coming_ = std::move(coming);
}

}  // namespace raysplats
