// SPDX-License-Identifier: Apache-2.0
#include "train/loss/exposure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <glm/vec4.hpp>

#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "train/exposure.cl";
constexpr std::size_t kGroup = 64;   // GROUP of cl/train/exposure.cl
constexpr std::size_t kBlock = 256;  // and its BLOCK

BuildOptions build_options(bool cut_out) {
  BuildOptions build;
  build.define("CUT_OUT", cut_out ? 1 : 0);
  return build;
}

}  // namespace

Exposure::Exposure(Context& context,
                   std::size_t views,
                   std::size_t slots,
                   bool cut_out,
                   std::span<const std::size_t> apart)
    : context_(context),
      views_(views),
      apart_(apart.size()),
      cut_out_(cut_out),
      apply_(context.kernel(kProgram, "apply_exposure", build_options(cut_out))),
      backward_(context.kernel(kProgram, "exposure_backward", build_options(cut_out))),
      moments_(context.kernel(kProgram, "exposure_moments", build_options(cut_out))),
      sum_(context.kernel(kProgram, "exposure_sums", build_options(cut_out))),
      solve_(context.kernel(kProgram, "exposure_solve", build_options(cut_out))),
      deltas_(context, kNumbers * views, "exposure"),
      sums_(context, kSums * slots, "exposure sums of a step"),
      waits_(context, views, "photos that steps do not show yet") {
  deltas_.clear();
  std::vector<std::uint32_t> waits(views, 0);
  for (const std::size_t view : apart) waits.at(view) = 1;
  waits_.upload(waits);
}

const Buffer<float>& Exposure::apply(const Buffer<float>& image,
                                     std::size_t view,
                                     std::array<float, 3> background,
                                     int width,
                                     int height) {
  const std::size_t pixels = pixel_count(width, height);
  picture_.ensure(context_, 4 * pixels, "exposed picture");
  apply_.launch(Range::linear(pixels, kGroup), image, deltas_, picture_,
                static_cast<std::uint32_t>(pixels), static_cast<std::uint32_t>(view), background[0],
                background[1], background[2]);
  return picture_;
}

void Exposure::backward(Buffer<float>& gradient,
                        std::size_t view,
                        std::array<float, 3> background,
                        int width,
                        int height) {
  const std::size_t pixels = pixel_count(width, height);
  backward_.launch(Range::linear(pixels, kGroup), deltas_, gradient,
                   static_cast<std::uint32_t>(pixels), static_cast<std::uint32_t>(view),
                   background[0], background[1], background[2]);
}

void Exposure::observe(const Buffer<float>& image,
                       const DevicePhoto& photo,
                       std::array<float, 3> background,
                       int width,
                       int height,
                       std::size_t slot) {
  const std::size_t pixels = pixel_count(width, height);
  const std::size_t blocks = (pixels + kBlock - 1) / kBlock;
  partials_.ensure(context_, kSums * blocks, "exposure sums");
  moments_.launch(Range::linear(blocks, kGroup), image, photo.words, partials_,
                  static_cast<std::int32_t>(pixels), photo.planes, photo.composite(cut_out_),
                  background[0], background[1], background[2]);
  sum_.launch(Range::linear(kSums * kGroup, kGroup), partials_, sums_,
              static_cast<std::uint32_t>(blocks), static_cast<std::uint32_t>(slot));
}

void Exposure::step(std::size_t view,
                    std::size_t slot,
                    double damping,
                    const Buffer<std::uint32_t>& guard,
                    bool joined) {
  const std::size_t members = joined ? views_ : views_ - apart_;
  solve_.launch(Range::linear(kGroup, kGroup), sums_, guard, waits_, deltas_,
                static_cast<std::uint32_t>(slot), static_cast<std::uint32_t>(views_),
                static_cast<std::uint32_t>(members), static_cast<std::uint32_t>(view),
                static_cast<float>(damping));
}

Exposure::Tale Exposure::tale(double error, std::size_t slot) const {
  constexpr double kLeastVariance = 1e-6;  // of colours that tell two numbers of the fit apart
  const std::vector<float> all = sums_.download();
  const auto sum = [&](int j) {
    return static_cast<double>(all[kSums * slot + static_cast<std::size_t>(j)]);
  };
  const double weight = sum(22);
  if (!(weight > 0)) return {};
  glm::dmat4 moments(0.0);
  int next = 0;
  for (int a = 0; a < 4; ++a) {
    for (int b = a; b < 4; ++b) moments[a][b] = moments[b][a] = sum(next++) / weight;
  }
  const glm::dmat4 inverse = glm::inverse(moments + glm::dmat4(kLeastVariance));
  Tale out{0, error};
  for (int c = 0; c < 3; ++c) {
    glm::dvec4 errors;
    for (int a = 0; a < 4; ++a) errors[a] = sum(10 + 4 * c + a) / weight;
    out.removable += glm::dot(errors, inverse * errors) / 3;
    // The photo is the picture and what it differs by.
    const double mean = moments[c][3] + errors[3];
    out.variance += (moments[c][c] + 2 * errors[c] - mean * mean) / 3;
  }
  if (!std::isfinite(out.removable) || !std::isfinite(out.variance)) return {};
  return {std::max(out.removable, 0.0), std::max(out.variance, 0.0)};
}

void Exposure::restore(const std::vector<float>& deltas) {
  if (deltas.size() != kNumbers * views_) {
    throw DataError(
        fmt::format("The exposures to go on with are {} numbers, but {} photos have {}: resume "
                    "with the data of the run",
                    deltas.size(), views_, kNumbers * views_));
  }
  deltas_.upload(deltas);
}

}  // namespace raysplats
