// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "light/triangle_tracer.hpp"
#include "raysplats/scene.hpp"
#include "shared/light_layout.h"

namespace raysplats {

/// The meshes, materials, textures, lights and environment of a scene on the device.
class SurfaceStore {
 public:
  /// Throws UsageError for materials, lights and textures out of range, DataError for meshes.
  SurfaceStore(Context& context, const Scene& scene);

  /// Throws DataError as validate() of scene/mesh/mesh.hpp; then nothing has changed.
  void set_meshes(const std::vector<Mesh>& meshes);

  TriangleTracer& triangles() { return triangles_; }
  const Buffer<float>& vertices() const { return vertices_; }
  const Buffer<std::uint32_t>& triangle_materials() const { return triangle_materials_; }
  const Buffer<float>& triangle_shadows() const { return triangle_shadows_; }
  const Buffer<RsMaterial>& materials() const { return materials_; }
  const Buffer<RsTexture>& textures() const { return textures_; }
  const Buffer<float>& texels() const { return texels_; }
  const Buffer<RsLight>& lights() const { return lights_; }
  const Buffer<RsEnvironment>& environment() const { return environment_; }
  const Buffer<float>& environment_picture() const { return environment_picture_; }
  /// Whether any surface shows light that falls on it.
  bool lit() const { return lit_; }

 private:
  Context* context_;
  std::vector<Material> kinds_;
  TriangleTracer triangles_;
  Buffer<float> vertices_;  // position, normal, uv of three corners per triangle
  Buffer<std::uint32_t> triangle_materials_;
  Buffer<float> triangle_shadows_;
  Buffer<RsMaterial> materials_;
  Buffer<RsTexture> textures_;
  Buffer<float> texels_;
  Buffer<RsLight> lights_;
  Buffer<RsEnvironment> environment_;
  Buffer<float> environment_picture_;
  bool lit_ = false;
};

}  // namespace raysplats
