// SPDX-License-Identifier: Apache-2.0
#include "view/picture_source.hpp"

#include "raysplats/error.hpp"
#include "raysplats/path_tracer.hpp"
#include "trace/model_impl.hpp"
#include "view/gaussian_pictures.hpp"
#include "view/sampling.hpp"

namespace raysplats::view {
namespace {

constexpr std::uint64_t kSceneSamples = 64;

class ScenePictures : public PictureSource {
 public:
  ScenePictures(Context& context, const Scene& scene)
      : tracer_(context, scene), seed_(scene.render.seed) {}

  Image draw(const ViewRequest& request, std::uint64_t sample, const Watch& watch) override {
    if (request.output != Output::kColor && request.output != Output::kAlpha)
      throw UsageError("A scene with surfaces has no single depth");
    tracer_.set_sampling(1, seed_ + sample);
    const Image rgba = tracer_.render(jittered(request.camera, sample), watch);
    if (rgba.pixels() == 0) return {};
    return request.output == Output::kAlpha ? alpha_picture(rgba) : rgba;
  }
  std::optional<glm::dvec3> point(const ViewRequest&) override { return std::nullopt; }
  std::uint64_t samples() const override { return kSceneSamples; }
  bool has_depth() const override { return false; }

 private:
  PathTracer tracer_;
  std::uint64_t seed_;
};

}  // namespace

std::unique_ptr<PictureSource> model_pictures(Context& context,
                                              const Model& model,
                                              const TraceOptions& options,
                                              const Mirrors& mirrors) {
  return std::make_unique<GaussianPictures>(context, gaussians_of(model, context), options,
                                            mirrors);
}

std::unique_ptr<PictureSource> scene_pictures(Context& context, const Scene& scene) {
  return std::make_unique<ScenePictures>(context, scene);
}

}  // namespace raysplats::view
