// SPDX-License-Identifier: Apache-2.0
#include "train/exposure.hpp"

#include <fmt/format.h>

#include "raysplats/error.hpp"
#include "scene/pixel_count.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "train/exposure.cl";
constexpr std::size_t kGroup = 64;   // GROUP of cl/train/exposure.cl
constexpr std::size_t kBlock = 256;  // and its BLOCK

}  // namespace

Exposure::Exposure(Context& context, std::size_t views, std::size_t slots)
    : context_(context),
      views_(views),
      apply_(context.kernel(kProgram, "apply_exposure")),
      backward_(context.kernel(kProgram, "exposure_backward")),
      moments_(context.kernel(kProgram, "exposure_moments")),
      sum_(context.kernel(kProgram, "exposure_sums")),
      solve_(context.kernel(kProgram, "exposure_solve")),
      deltas_(context, kNumbers * views, "exposure"),
      sums_(context, kSums * slots, "exposure sums of a step") {
  deltas_.clear();
}

const Buffer<float>& Exposure::apply(const Buffer<float>& image,
                                     std::size_t view,
                                     int width,
                                     int height) {
  const std::size_t pixels = pixel_count(width, height);
  picture_.ensure(context_, 4 * pixels, "exposed picture");
  apply_.launch(Range::linear(pixels, kGroup), image, deltas_, picture_,
                static_cast<std::uint32_t>(pixels), static_cast<std::uint32_t>(view));
  return picture_;
}

void Exposure::backward(Buffer<float>& gradient, std::size_t view, int width, int height) {
  const std::size_t pixels = pixel_count(width, height);
  backward_.launch(Range::linear(pixels, kGroup), deltas_, gradient,
                   static_cast<std::uint32_t>(pixels), static_cast<std::uint32_t>(view));
}

void Exposure::observe(const Buffer<float>& image,
                       const DevicePhoto& photo,
                       bool alpha_is_background,
                       std::array<float, 3> background,
                       int width,
                       int height,
                       std::size_t slot) {
  const std::size_t pixels = pixel_count(width, height);
  const std::size_t blocks = (pixels + kBlock - 1) / kBlock;
  partials_.ensure(context_, kSums * blocks, "exposure sums");
  moments_.launch(Range::linear(blocks, kGroup), image, photo.words, partials_,
                  static_cast<std::int32_t>(pixels), photo.planes,
                  photo.composite(alpha_is_background), background[0], background[1],
                  background[2]);
  sum_.launch(Range::linear(kSums * kGroup, kGroup), partials_, sums_,
              static_cast<std::uint32_t>(blocks), static_cast<std::uint32_t>(slot));
}

void Exposure::step(std::size_t view,
                    std::size_t slot,
                    double damping,
                    const Buffer<std::uint32_t>& guard) {
  solve_.launch(Range::linear(kGroup, kGroup), sums_, guard, deltas_,
                static_cast<std::uint32_t>(slot), static_cast<std::uint32_t>(views_),
                static_cast<std::uint32_t>(view), static_cast<float>(damping));
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
