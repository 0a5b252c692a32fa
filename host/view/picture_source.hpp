// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "raysplats/context.hpp"
#include "raysplats/image.hpp"
#include "raysplats/mirrors.hpp"
#include "raysplats/model.hpp"
#include "raysplats/scene.hpp"
#include "raysplats/trace_options.hpp"
#include "view/view_request.hpp"

namespace raysplats::view {

/// Hears the share of a picture that is done, several times a second, and returns false to stop.
using Watch = std::function<bool(double share)>;

/// Draws what the page sees.
class PictureSource {
 public:
  virtual ~PictureSource() = default;

  /// RGBA of request.camera, which may have another size than the page wants; the picture of sample
  /// number `sample` of a still view. Empty when `watch` stopped it. Throws what the tracer throws,
  /// UsageError for an output that there is not.
  virtual Image draw(const ViewRequest& request, std::uint64_t sample, const Watch& watch) = 0;
  /// The point of the world in front of the camera's centre ray; nothing where it meets nothing.
  /// Throws as draw().
  virtual std::optional<glm::dvec3> point(const ViewRequest& request) = 0;
  /// How many samples of a still view are worth it.
  virtual std::uint64_t samples() const = 0;
  /// Whether there are depths, normals and numbers of hits.
  virtual bool has_depth() const = 0;
};

/// Pictures into which pages can drop meshes.
class MeshPictures : public PictureSource {
 public:
  /// Draws exactly these besides its own, in the world; their materials index surface_materials().
  /// Throws what PathTracer throws, and draws what it drew before then.
  virtual void set_meshes(const std::vector<Mesh>& meshes) = 0;
};

/// Gaussians alone, or with mirrors: what `render MODEL` draws. The model and the context outlive
/// it.
std::unique_ptr<PictureSource> model_pictures(Context& context,
                                              const Model& model,
                                              const TraceOptions& options,
                                              const Mirrors& mirrors);

/// A scene file's: what `render scene.toml` draws, its first frame's meshes.
std::unique_ptr<MeshPictures> scene_pictures(Context& context, Scene scene);

/// `plain` until there are meshes, then `scene` with them. `scene` is asked for when the first mesh
/// comes, and its memory is given back with the last.
std::unique_ptr<MeshPictures> pictures_with_meshes(Context& context,
                                                   std::unique_ptr<PictureSource> plain,
                                                   std::function<Scene()> scene);

}  // namespace raysplats::view
