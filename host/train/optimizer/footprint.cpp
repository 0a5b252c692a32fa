// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/footprint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "raysplats/error.hpp"
#include "scene/camera/pixel_spacing.hpp"
#include "scene/gaussians/activation.hpp"

namespace raysplats {
namespace {

constexpr char kProgram[] = "train/footprint.cl";
constexpr std::size_t kGroup = 64;
constexpr double kMargin =
    0.15;  // of the picture's size: Gaussians reach in from beyond its border

constexpr float kNoLimit = std::numeric_limits<float>::infinity();

// The number that is trained for a standard deviation; a sigmoid has none from 1 on.
float scale_parameter(double size, ScaleActivation activation) {
  if (activation == ScaleActivation::kExp) return static_cast<float>(std::log(size));
  return size < 1.0 ? static_cast<float>(logit(size)) : kNoLimit;
}

BuildOptions build_options(const DeviceGaussians& gaussians) {
  BuildOptions build;
  build.define("SIGMOID_SCALE", gaussians.activation == ScaleActivation::kSigmoid ? 1 : 0);
  return build;
}

}  // namespace

RsFootprintView footprint_view(const Camera& camera) {
  RsFootprintView view{};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      view.rotation[3 * row + column] = static_cast<float>(camera.rotation[column][row]);
  }
  const glm::dvec3 center = camera.center();
  for (int a = 0; a < 3; ++a) view.center[a] = static_cast<float>(center[a]);
  const double sizes[2] = {static_cast<double>(camera.width), static_cast<double>(camera.height)};
  const double middles[2] = {camera.cx, camera.cy};
  const double focals[2] = {camera.fx, camera.fy};
  switch (camera.model) {
    case CameraModel::kPinhole:
    case CameraModel::kOpenCv:
      for (int a = 0; a < 2; ++a) {
        view.low[a] = static_cast<float>((-kMargin * sizes[a] - middles[a]) / focals[a]);
        view.high[a] = static_cast<float>(((1 + kMargin) * sizes[a] - middles[a]) / focals[a]);
      }
      view.kind = RS_FOOTPRINT_DEPTH;
      break;
    case CameraModel::kFisheye:
    case CameraModel::kEquirectangular:
      view.kind = RS_FOOTPRINT_DISTANCE;
      break;
    case CameraModel::kOrthographic:
      view.kind = RS_FOOTPRINT_CONSTANT;
      break;
    case CameraModel::kPhotoLens:
      break;  // of no picture that is rendered
  }
  view.spacing = static_cast<float>(pixel_spacing(camera));
  return view;
}

Footprint::Footprint(Context& context,
                     std::span<const Camera> cameras,
                     double share,
                     const ScaleLimits& limits)
    : context_(context),
      share_(share),
      limits_(limits),
      views_(static_cast<std::uint32_t>(cameras.size())) {
  if (share <= 0) return;
  std::vector<RsFootprintView> views;
  views.reserve(cameras.size());
  for (const Camera& camera : cameras) views.push_back(footprint_view(camera));
  cameras_ = Buffer<RsFootprintView>(context, views.size(), "footprint cameras");
  cameras_.upload(views);
}

void Footprint::update(const DeviceGaussians& gaussians) {
  if (share_ <= 0) return;
  if (lows_.size() != gaussians.count)
    lows_ = Buffer<float>(context_, gaussians.count, "least scales");
  context_.kernel(kProgram, "footprint_floor", build_options(gaussians))
      .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
              views_, static_cast<float>(share_), cameras_, gaussians.means, lows_);
}

void Footprint::restore(std::span<const float> lows) {
  if (share_ <= 0 || lows.empty()) return;
  lows_ = Buffer<float>(context_, lows.size(), "least scales");
  lows_.upload(lows);
}

void Footprint::apply(DeviceGaussians& gaussians,
                      const Buffer<std::uint32_t>& guard,
                      double thickness) {
  if (limits_.least > 0 || limits_.greatest > 0) {
    const double low = limits_.least, high = limits_.greatest;
    context_.kernel(kProgram, "limit_scales", build_options(gaussians))
        .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
                low > 0 ? scale_parameter(low, gaussians.activation) : -kNoLimit,
                high > 0 ? scale_parameter(high, gaussians.activation) : kNoLimit, guard,
                gaussians.scales);
  }
  if (share_ > 0) raise(gaussians, guard);
  if (thickness < 1) {
    context_.kernel(kProgram, "flatten_scales", build_options(gaussians))
        .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
                static_cast<float>(std::log(thickness)), guard, gaussians.scales);
  }
}

void Footprint::raise(DeviceGaussians& gaussians, const Buffer<std::uint32_t>& guard) {
  if (lows_.size() < gaussians.count) {
    throw UsageError(fmt::format("The least sizes are known for {} Gaussians, not {}: update first",
                                 lows_.size(), gaussians.count));
  }
  context_.kernel(kProgram, "raise_scales", build_options(gaussians))
      .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
              lows_, guard, gaussians.scales);
}

}  // namespace raysplats
