// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/dataset.hpp"
#include "train/loss/depth_cache.hpp"
#include "train/loss/device_photo.hpp"

namespace raysplats {

/// What is known of the depths of training views, as a term of the loss: `weight` times the mean of
/// m |E / d - 1| over the pixels whose depth d is known, E being the expected depth of their rays
/// and m how much they count (masks, alpha). It does not change with the unit of length.
class DepthSupervision {
 public:
  /// Reads the depths of some views of a data set, of which maps may take `budget` bytes of the
  /// device (DepthCache). Throws DataError as io::view_depths(), and UsageError where nothing is
  /// known of any.
  DepthSupervision(Context& context,
                   const Dataset& dataset,
                   std::span<const std::size_t> views,
                   double weight,
                   double unit,
                   std::size_t budget);

  /// Views that have a depth map.
  std::size_t maps() const { return cache_.with_maps(); }
  /// Reads what backward() will need of these views in the background.
  void prefetch(std::span<const SizedView> wanted) { cache_.prefetch(wanted); }
  /// Brings what it needs of a view to the device.
  void prepare(const SizedView& wanted) { cache_.get(wanted); }

  /// For the picture and depth of a view (ViewTracer::image(), ViewTracer::depth()) and its photo
  /// of that size: adds the gradient for the coverage to `image_gradient` and writes gradient().
  /// Enqueues without waiting.
  void backward(const SizedView& view,
                const Buffer<float>& image,
                const Buffer<float>& depth,
                const DevicePhoto& photo,
                Buffer<float>& image_gradient);
  /// Of the last backward(): for the sum of T alpha depth of every pixel.
  const Buffer<float>& gradient() const { return gradient_; }

 private:
  Context& context_;
  double weight_;
  Kernel add_gradient_, add_listed_gradient_;
  DepthCache cache_;
  Buffer<float> gradient_;
};

}  // namespace raysplats
