// SPDX-License-Identifier: Apache-2.0
#include "view/gaussian_pictures.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <utility>

#include "raysplats/error.hpp"
#include "scene/camera/camera_model.hpp"
#include "view/sampling.hpp"

namespace raysplats::view {
namespace {

constexpr std::uint64_t kSamples = 16;
/// Alpha from which on a ray has met something to turn around.
constexpr float kMet = 0.5f;
constexpr int kMedian = 1;  ///< channel of the depths

/// Lets a tracer be watched while it lives.
class Watched {
 public:
  Watched(ViewTracer& tracer, const Watch& watch) : tracer_(tracer) {
    if (watch) tracer_.set_watch(watch);
  }
  ~Watched() { tracer_.set_watch({}); }
  Watched(const Watched&) = delete;
  Watched& operator=(const Watched&) = delete;

 private:
  ViewTracer& tracer_;
};

}  // namespace

GaussianPictures::GaussianPictures(Context& context,
                                   const DeviceGaussians& gaussians,
                                   const TraceOptions& options,
                                   Mirrors mirrors)
    : context_(context),
      gaussians_(&gaussians),
      options_(options),
      mirrors_(std::move(mirrors)),
      near_(options.near_depth),
      order_(options.hit_order) {}

std::uint64_t GaussianPictures::samples() const { return kSamples; }

void GaussianPictures::release() {
  color_.reset();
  depth_.reset();
  normals_.reset();
}

ViewTracer& GaussianPictures::tracer(bool depth, const ViewRequest& request) {
  if (depth && !has_depth()) throw UsageError("A scene with mirrors has no single depth");
  // With mirrors there is no camera that could be near.
  const float wanted = has_depth() ? request.near_depth.value_or(options_.near_depth) : near_;
  const HitOrder order = request.hit_order.value_or(options_.hit_order);
  if (wanted != near_ || order != order_) release();
  near_ = wanted;
  order_ = order;
  std::unique_ptr<ViewTracer>& tracer = depth ? depth_ : color_;
  if (!tracer) {
    TraceOptions options = options_;
    options.near_depth = near_;
    options.hit_order = order_;
    options.depth = depth;
    tracer = std::make_unique<ViewTracer>(context_, options, mirrors_);
  }
  return *tracer;
}

Image GaussianPictures::normals_of(const Camera& camera, const Watch& watch) {
  if (!normals_) {
    TraceOptions options = options_;
    options.near_depth = near_;
    options.hit_order = order_;
    normals_ = std::make_unique<NormalPictures>(context_, options);
  }
  return normals_->draw(*gaussians_, camera, watch);
}

Image GaussianPictures::draw(const ViewRequest& request, std::uint64_t sample, const Watch& watch) {
  const auto turn = context_.lock();
  try {
    return drawn(request, sample, watch);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInterrupted) return {};
    // Others may need what it has; half of it is of no use here.
    if (error.code() != ErrorCode::kUsage) release();
    throw;
  }
}

Image GaussianPictures::drawn(const ViewRequest& request,
                              std::uint64_t sample,
                              const Watch& watch) {
  const bool depth = request.output == Output::kDepth || request.output == Output::kHits;
  const bool normals = request.output == Output::kNormals;
  if (normals && !has_depth()) throw UsageError("A scene with mirrors has no single normal");
  ViewTracer& views = tracer(depth, request);
  views.set_background(request.background.value_or(options_.background),
                       request.background ? SkyLight() : options_.sky);
  const Watched watched(views, watch);
  const Camera camera = jittered(request.camera, sample);
  Image sums;
  views.forward(*gaussians_, camera);
  if (normals) sums = normals_of(camera, watch);
  const Image rgba = views.download_image();
  if (normals) return normals_picture(sums, rgba, camera);
  if (request.output == Output::kHits) return hits_picture(views.download_depth());
  if (depth) return depth_picture(views.download_depth(), rgba);
  return request.output == Output::kAlpha ? alpha_picture(rgba) : rgba;
}

std::optional<glm::dvec3> GaussianPictures::point(const ViewRequest& request) {
  const auto turn = context_.lock();
  ViewTracer& views = tracer(true, request);
  views.forward(*gaussians_, request.camera);
  const int x = request.camera.width / 2;
  const int y = request.camera.height / 2;
  const float z = views.download_depth().at(x, y, kMedian);
  if (!(views.download_image().at(x, y, 3) > kMet) || !(z > 0.0f)) return std::nullopt;
  const CameraRay ray = camera_ray(request.camera, x + 0.5, y + 0.5);
  // Depth is along the axis.
  const glm::dvec3 axis = glm::transpose(request.camera.rotation)[2];
  return ray.origin + static_cast<double>(z) / glm::dot(axis, ray.direction) * ray.direction;
}

}  // namespace raysplats::view
