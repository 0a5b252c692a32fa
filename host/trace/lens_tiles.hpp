// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <optional>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/camera.hpp"
#include "shared/layout.h"

namespace raysplats {

/// How the tiles of a picture through a lens are traced in packets (cl/trace/lens_tiles.cl): every
/// tile belongs to one face of a cube around the camera, which sees it as a pinhole would. Kept
/// until the lens changes; the pose has no part in it.
class LensTiles {
 public:
  LensTiles(Context& context, int tile_size);

  /// Prepares the tiles of a non-pinhole central camera; waits for the device when the lens is new.
  /// Returns false when a tile sees too much for a face (of small pictures all around): its rays
  /// must be traced one by one.
  bool prepare(const Camera& camera);

  /// Faces that see any tile, in order of their numbers.
  const std::vector<int>& faces() const { return faces_; }
  /// Camera axes to the axes of a face.
  static glm::dmat3 rotation(int face);
  /// Box around all rays of a face in its tangent coordinates: x0, y0, x1, y1.
  const std::array<float, 4>& window(int face) const {
    return windows_[static_cast<std::size_t>(face)];
  }
  /// Planes X and Y of tangent coordinates of all pixels; NaN where one sees nothing.
  const Buffer<float>& tangents() const { return tangents_; }
  const Buffer<RsLensTile>& tiles() const { return tiles_; }
  /// Boxes around the tiles of a face in every row, then in every column.
  const Buffer<std::array<float, 4>>& spans(int face) const {
    return spans_[static_cast<std::size_t>(face)];
  }

 private:
  void find_windows(const std::vector<RsLensTile>& tiles);

  Context* context_;
  int tile_size_;
  std::optional<Camera> camera_;  // of what is kept, without its pose
  bool served_ = false;
  std::size_t tiles_x_ = 0;
  std::vector<int> faces_;
  std::array<std::array<float, 4>, RS_FACES> windows_{};
  Buffer<float> tangents_;
  Buffer<RsLensTile> tiles_;
  std::array<Buffer<std::array<float, 4>>, RS_FACES> spans_;
};

}  // namespace raysplats
