// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>

#include "bvh/lbvh.hpp"
#include "raysplats/device.hpp"
#include "raysplats/scene.hpp"

namespace raysplats {

/// Device memory that PathTracer needs for a scene, in bytes.
class PathMemory {
 public:
  PathMemory(const Scene& scene, const DeviceInfo& device);

  /// Other settings, of the scene's lights and glass; `of_many` as in PathTracer::set_sampling().
  void set_render(const RenderSettings& settings, bool of_many = false);
  /// Other meshes in the same scene.
  void set_meshes(std::size_t triangles);

  /// Whether the camera rays of a picture with so many pixels can be traced in packets, all those
  /// of a sample at once: they leave one point, and the device has room.
  bool packets(std::size_t pixels) const;
  /// Pixels whose paths are traced at once: as many as fit their share of the memory budget.
  std::size_t batch() const { return batch_; }
  /// Parameters of the Gaussians and their tree.
  std::size_t gaussians() const { return gaussians_; }
  /// Meshes with their tree, textures, the environment's picture.
  std::size_t surfaces() const { return meshes_ + pictures_; }
  /// Of a picture with so many pixels; with glass, whose paths split, at most this. With what
  /// packets need at most where they can be used.
  std::size_t paths(std::size_t pixels) const;
  std::size_t total(std::size_t pixels) const { return gaussians() + surfaces() + paths(pixels); }
  std::size_t largest_buffer(std::size_t pixels) const;

  /// Throws ResourceError with the figures when the device has less, a tenth left for others.
  void check(std::size_t pixels) const;

 private:
  std::size_t rays(std::size_t pixels) const;
  std::size_t packet_bytes(std::size_t pixels) const;

  DeviceInfo device_;
  TreeForm form_;
  std::size_t batch_, pixel_, pixel_largest_;
  std::size_t packets_;
  bool one_point_ = false;  // all rays of a sample leave it
  std::size_t gaussians_, pictures_, meshes_ = 0;
  std::size_t largest_, largest_mesh_ = 0;
};

/// Of meshes with this many triangles: corners, attributes and the tree over them.
std::size_t mesh_bytes(std::size_t triangles, const TreeForm& form);

}  // namespace raysplats
