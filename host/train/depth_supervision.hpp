// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "io/depth_map.hpp"
#include "raysplats/dataset.hpp"
#include "train/device_photo.hpp"

namespace raysplats {

/// What is known of the depths of training views, as a term of the loss: `weight` times the mean of
/// m |E / d - 1| over the pixels whose depth d is known, E being the expected depth of their rays
/// and m how much they count (masks, alpha). It does not change with the unit of length.
class DepthSupervision {
 public:
  /// Reads the depths of some views of a data set. Throws DataError as io::view_depths(), and
  /// UsageError where nothing is known of any.
  DepthSupervision(Context& context,
                   const Dataset& dataset,
                   std::span<const std::size_t> views,
                   double weight,
                   double unit);

  /// For the picture and depth of a view (ViewTracer::image(), ViewTracer::depth()) and its photo
  /// of that size: adds the gradient for the coverage to `image_gradient` and writes gradient().
  /// Enqueues without waiting.
  void backward(std::size_t view,
                int width,
                int height,
                const Buffer<float>& image,
                const Buffer<float>& depth,
                const DevicePhoto& photo,
                Buffer<float>& image_gradient);
  /// Of the last backward(): for the sum of T alpha depth of every pixel.
  const Buffer<float>& gradient() const { return gradient_; }

 private:
  // At the size that was asked for last.
  struct Target {
    int width = 0, height = 0;
    float known = 0;  // pixels
    Buffer<float> depths;
  };
  const Target& target(std::size_t view, int width, int height);

  Context& context_;
  double weight_;
  Kernel slopes_;
  std::vector<io::DepthMap> maps_;
  std::vector<Target> targets_;
  Buffer<float> gradient_;
};

}  // namespace raysplats
