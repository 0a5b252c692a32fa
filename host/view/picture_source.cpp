// SPDX-License-Identifier: Apache-2.0
#include "view/picture_source.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "core/camera_model.hpp"
#include "eval/frame_writer.hpp"
#include "raysplats/error.hpp"
#include "raysplats/path_tracer.hpp"
#include "raysplats/tracer.hpp"

namespace raysplats::view {
namespace {

constexpr std::uint64_t kModelSamples = 16;
constexpr std::uint64_t kSceneSamples = 64;
/// Alpha from which on a ray has met something to turn around.
constexpr float kMet = 0.5f;
constexpr int kMedian = 1;  ///< channel of the depths

/// The radical inverse: the samples of a pixel fill it evenly, however many there are (Halton
/// 1960).
double halton(std::uint64_t index, std::uint64_t base) {
  double value = 0.0;
  double digit = 1.0;
  for (; index > 0; index /= base) {
    digit /= static_cast<double>(base);
    value += digit * static_cast<double>(index % base);
  }
  return value;
}

/// The first sample goes through the pixel's centre, as the pictures of `render`.
Camera jittered(Camera camera, std::uint64_t sample) {
  if (sample == 0) return camera;
  camera.cx += halton(sample, 2) - 0.5;
  camera.cy += halton(sample, 3) - 0.5;
  return camera;
}

/// Alpha as grey, opaque.
Image alpha_picture(const Image& rgba) {
  Image out = rgba;
  for (std::size_t i = 0; i < rgba.pixels(); ++i) {
    float* pixel = &out.data[4 * i];
    pixel[0] = pixel[1] = pixel[2] = pixel[3];
  }
  return out;
}

class ModelPictures : public PictureSource {
 public:
  ModelPictures(Context& context,
                const Model& model,
                const TraceOptions& options,
                const Mirrors& mirrors)
      : context_(context), model_(model), options_(options), mirrors_(mirrors) {
    options_.depth = false;
    tracer_ = std::make_unique<Tracer>(context_, options_, mirrors_);
  }

  Image draw(const ViewRequest& request, std::uint64_t sample, const Watch& watch) override {
    set_near(request.near_depth);
    const bool depth = request.output == Output::kDepth;
    Tracer& tracer = depth ? depth_tracer() : *tracer_;
    tracer.set_background(request.background.value_or(options_.background));
    const Image rgba = tracer.render(model_, jittered(request.camera, sample), false, watch);
    if (rgba.pixels() == 0) return {};
    if (depth) return depth_picture(tracer.depth(), rgba);
    return request.output == Output::kAlpha ? alpha_picture(rgba) : rgba;
  }

  std::optional<glm::dvec3> point(const ViewRequest& request) override {
    if (!has_depth()) return std::nullopt;
    set_near(request.near_depth);
    Tracer& tracer = depth_tracer();
    const Image rgba = tracer.render(model_, request.camera);
    const Image depth = tracer.depth();
    const int x = request.camera.width / 2;
    const int y = request.camera.height / 2;
    const float z = depth.at(x, y, kMedian);
    if (!(rgba.at(x, y, 3) > kMet) || !(z > 0.0f)) return std::nullopt;
    const CameraRay ray = camera_ray(request.camera, x + 0.5, y + 0.5);
    // Depth is along the axis.
    const glm::dvec3 axis = glm::transpose(request.camera.rotation)[2];
    return ray.origin + static_cast<double>(z) / glm::dot(axis, ray.direction) * ray.direction;
  }

  std::uint64_t samples() const override { return kModelSamples; }
  bool has_depth() const override { return mirrors_.meshes.empty(); }

 private:
  void set_near(const std::optional<float>& wanted) {
    const float near_depth = wanted.value_or(options_.near_depth);
    // With mirrors there is no camera that could be near.
    if (near_depth == near_ || !mirrors_.meshes.empty()) return;
    near_ = near_depth;
    depth_tracer_.reset();
    TraceOptions options = options_;
    options.near_depth = near_depth;
    tracer_ = std::make_unique<Tracer>(context_, options, mirrors_);
  }

  Tracer& depth_tracer() {
    if (!has_depth()) throw UsageError("A scene with mirrors has no single depth");
    if (!depth_tracer_) {
      TraceOptions options = options_;
      options.near_depth = near_;
      options.depth = true;
      depth_tracer_ = std::make_unique<Tracer>(context_, options);
    }
    return *depth_tracer_;
  }

  Context& context_;
  const Model& model_;
  TraceOptions options_;
  Mirrors mirrors_;
  float near_ = options_.near_depth;
  std::unique_ptr<Tracer> tracer_;
  std::unique_ptr<Tracer> depth_tracer_;  ///< once somebody asks for depths
};

class ScenePictures : public PictureSource {
 public:
  ScenePictures(Context& context, const Scene& scene)
      : tracer_(context, scene), seed_(scene.render.seed) {}

  Image draw(const ViewRequest& request, std::uint64_t sample, const Watch& watch) override {
    if (request.output == Output::kDepth)
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

Image depth_picture(const Image& depth, const Image& rgba) {
  Image expected(depth.width, depth.height, 1);
  for (std::size_t i = 0; i < expected.pixels(); ++i)
    expected.data[i] = depth.data[i * static_cast<std::size_t>(depth.channels)];
  const Image grey = depth_preview(expected, rgba);
  Image out(rgba.width, rgba.height, 4, 1.0f);
  for (std::size_t i = 0; i < grey.pixels(); ++i) std::fill_n(&out.data[4 * i], 3, grey.data[i]);
  return out;
}

std::unique_ptr<PictureSource> model_pictures(Context& context,
                                              const Model& model,
                                              const TraceOptions& options,
                                              const Mirrors& mirrors) {
  return std::make_unique<ModelPictures>(context, model, options, mirrors);
}

std::unique_ptr<PictureSource> scene_pictures(Context& context, const Scene& scene) {
  return std::make_unique<ScenePictures>(context, scene);
}

}  // namespace raysplats::view
