// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <future>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "io/photo/depth_map.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats {

/// A pixel, counted row by row, and its depth.
struct DepthPoint {
  std::uint32_t pixel = 0;
  float depth = 0;
};

/// Points of a picture with fewer pixels: as io::reduced(), the median of those in the area of
/// each. Ordered by their pixels.
std::vector<DepthPoint> reduced(
    std::span<const DepthPoint> points, int width, int height, int to_width, int to_height);

/// What is known of the depths of a picture, on the device.
struct DeviceDepths {
  int width = 0, height = 0;
  std::size_t known = 0;         ///< pixels whose depth is known
  bool listed = false;           ///< these pixels alone have a place
  Buffer<std::uint32_t> pixels;  ///< which they are, where they are listed
  Buffer<float> depths;          ///< theirs; else of every pixel, 0 where it is unknown
};

/// A view at the size of its picture in a step.
struct SizedView {
  std::size_t view = 0;
  int width = 0, height = 0;

  friend bool operator==(const SizedView&, const SizedView&) = default;
};

/// Bytes on the device of the depth maps that some views have, at full size.
std::size_t depth_map_bytes(const Dataset& dataset, std::span<const std::size_t> views);

/// Known depths on the device. Sparse points are few and stay, as lists. Depth maps are kept as
/// photos are (PhotoCache): the first ones that fit the budget stay on the device, at the size that
/// was asked for last, and nowhere else; the others are read again whenever they are asked for.
class DepthCache {
 public:
  /// Makes sure that the depths of some views of a data set can be read; `unit` as in
  /// io::view_depths(), whose DataErrors it throws. A view whose map knows nothing has no depths,
  /// and a warning counts them; where all maps are so and no view has points, that is a DataError.
  /// `budget` in bytes of the device, of maps.
  DepthCache(Context& context,
             const Dataset& dataset,
             std::span<const std::size_t> views,
             double unit,
             std::size_t budget);

  /// The depths of a view (an index into `views`) reduced to width x height, until the next call:
  /// io::reduced() of those at full size. Waits for the file, not for the device.
  const DeviceDepths& get(const SizedView& wanted);

  /// Reads and reduces what get() will need of these in the background. What an earlier call asked
  /// for, this one does not and nobody got is dropped.
  void prefetch(std::span<const SizedView> wanted);

  std::size_t with_maps() const { return with_maps_; }      ///< views
  std::size_t with_points() const { return with_points_; }  ///< that have no map
  /// Bytes of the maps that stay on the device.
  std::size_t cached_bytes() const { return cached_; }

 private:
  // A map at the size that is asked for.
  struct SizedMap {
    std::shared_ptr<const std::vector<float>> values;
    std::size_t known = 0;  // pixels
  };
  struct Coming {
    SizedView wanted;
    std::future<SizedMap> map;
  };

  struct Entry {
    View source;                     // with its map, if it has one that knows something
    std::vector<DepthPoint> points;  // else what is known, at full size
    DeviceDepths resident;
  };

  const DeviceDepths* held(const SizedView& wanted) const;
  SizedMap load(const SizedView& wanted) const;
  SizedMap take(const SizedView& wanted);
  void upload_points(Entry& entry, int width, int height);

  Context& context_;
  double unit_;
  std::size_t budget_;
  std::size_t cached_ = 0;
  std::size_t with_maps_ = 0, with_points_ = 0;
  std::vector<Entry> entries_;
  DeviceDepths passing_;  // of a map that found no room
  std::size_t passing_view_ = 0;
  std::map<std::size_t, Coming> coming_;  // by view; last: threads read the entries
};

}  // namespace raysplats
