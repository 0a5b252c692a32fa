// SPDX-License-Identifier: Apache-2.0
#include "view/picture_source.hpp"

#include <utility>

#include "raysplats/path_tracer.hpp"
#include "trace/model_impl.hpp"
#include "view/dropped_meshes.hpp"
#include "view/gaussian_pictures.hpp"
#include "view/sampling.hpp"

namespace raysplats::view {
namespace {

constexpr std::uint64_t kSceneSamples = 64;

/// The scene with the materials of dropped meshes behind its own.
Scene prepared(Scene scene) {
  for (Material& material : surface_materials()) scene.materials.push_back(std::move(material));
  return scene;
}

class ScenePictures : public MeshPictures {
 public:
  ScenePictures(Context& context, Scene scene)
      : ScenePictures(context, prepared(std::move(scene)), 0) {}

  Image draw(const ViewRequest& request, std::uint64_t sample, const Watch& watch) override {
    const Camera camera = jittered(request.camera, sample);
    if (request.output == Output::kColor || request.output == Output::kAlpha) {
      // A picture that moves has one sample, which is sharp; those of a still one are averaged.
      tracer_.set_sampling(1, seed_ + sample, !request.moving);
      const Image rgba = tracer_.render(camera, watch);
      if (rgba.pixels() == 0) return {};
      return request.output == Output::kAlpha ? alpha_picture(rgba) : rgba;
    }
    const PathTracer::FirstHits first = tracer_.first_hits(camera, watch);
    if (first.alpha.pixels() == 0) return {};
    if (request.output == Output::kDepth) return depth_picture(first.depth, first.alpha);
    if (request.output == Output::kHits) return hits_picture(first.depth);
    return normals_picture(first.normals, first.alpha, camera);
  }
  std::optional<glm::dvec3> point(const ViewRequest& request) override {
    return tracer_.first_point(request.camera);
  }
  std::uint64_t samples() const override { return kSceneSamples; }
  bool has_depth() const override { return true; }

  void set_meshes(const std::vector<Mesh>& meshes) override {
    std::vector<Mesh> all = own_;
    for (const Mesh& mesh : meshes) {
      all.push_back(mesh);
      for (std::uint32_t& material : all.back().materials) material += surfaces_;
    }
    try {
      tracer_.set_meshes(all);
    } catch (...) {
      tracer_.set_meshes(shown_);
      throw;
    }
    shown_ = std::move(all);
  }

 private:
  ScenePictures(Context& context, const Scene& scene, int)
      : tracer_(context, scene),
        seed_(scene.render.seed),
        own_(scene.meshes),
        shown_(own_),
        surfaces_(static_cast<std::uint32_t>(scene.materials.size() - surface_materials().size())) {
  }

  PathTracer tracer_;
  std::uint64_t seed_;
  std::vector<Mesh> own_, shown_;
  std::uint32_t surfaces_;  ///< number of the first of surface_materials()
};

class PicturesWithMeshes : public MeshPictures {
 public:
  PicturesWithMeshes(Context& context,
                     std::unique_ptr<PictureSource> plain,
                     std::function<Scene()> scene)
      : context_(context), plain_(std::move(plain)), scene_(std::move(scene)) {}

  Image draw(const ViewRequest& request, std::uint64_t sample, const Watch& watch) override {
    return source().draw(request, sample, watch);
  }
  std::optional<glm::dvec3> point(const ViewRequest& request) override {
    return source().point(request);
  }
  std::uint64_t samples() const override { return source().samples(); }
  bool has_depth() const override { return plain_->has_depth(); }

  void set_meshes(const std::vector<Mesh>& meshes) override {
    if (meshes.empty()) return staged_.reset();
    if (staged_) return staged_->set_meshes(meshes);
    auto staged = std::make_unique<ScenePictures>(context_, scene_());
    staged->set_meshes(meshes);
    staged_ = std::move(staged);
  }

 private:
  PictureSource& source() const { return staged_ ? *staged_ : *plain_; }

  Context& context_;
  std::unique_ptr<PictureSource> plain_;
  std::function<Scene()> scene_;
  std::unique_ptr<ScenePictures> staged_;  ///< while there are meshes
};

}  // namespace

std::unique_ptr<PictureSource> model_pictures(Context& context,
                                              const Model& model,
                                              const TraceOptions& options,
                                              const Mirrors& mirrors) {
  return std::make_unique<GaussianPictures>(context, gaussians_of(model, context), options,
                                            mirrors);
}

std::unique_ptr<MeshPictures> scene_pictures(Context& context, Scene scene) {
  return std::make_unique<ScenePictures>(context, std::move(scene));
}

std::unique_ptr<MeshPictures> pictures_with_meshes(Context& context,
                                                   std::unique_ptr<PictureSource> plain,
                                                   std::function<Scene()> scene) {
  return std::make_unique<PicturesWithMeshes>(context, std::move(plain), std::move(scene));
}

}  // namespace raysplats::view
