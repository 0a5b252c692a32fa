// SPDX-License-Identifier: Apache-2.0
#include "train/exposure.hpp"

#include <fmt/format.h>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "train/exposure.cl";
constexpr std::size_t kGroup = 64;
constexpr std::size_t kBlock = 256;  // as in cl/train/exposure.cl
constexpr float kBeta1 = 0.9f;
constexpr float kBeta2 = 0.999f;
constexpr float kEpsilon = 1e-15f;

std::uint32_t pixels_of(int width, int height) {
  return static_cast<std::uint32_t>(width) * static_cast<std::uint32_t>(height);
}

}  // namespace

Exposure::Exposure(Context& context, std::size_t views, std::size_t slots)
    : context_(context),
      views_(views),
      apply_(context.kernel(kProgram, "apply_exposure")),
      gradient_(context.kernel(kProgram, "exposure_gradient")),
      sum_(context.kernel(kProgram, "exposure_sums")),
      step_(context.kernel(kProgram, "exposure_step")),
      sums_(context, kNumbers * slots, "exposure gradients") {
  for (Buffer<float>* buffer : {&deltas_, &first_, &second_, &steps_}) {
    *buffer = Buffer<float>(context, kNumbers * views, "exposure");
    buffer->clear();
  }
}

const Buffer<float>& Exposure::apply(const Buffer<float>& image,
                                     std::size_t view,
                                     int width,
                                     int height) {
  const std::uint32_t pixels = pixels_of(width, height);
  picture_.ensure(context_, 4 * static_cast<std::size_t>(pixels), "exposed picture");
  apply_.launch(Range::linear(pixels, kGroup), image, deltas_, picture_, pixels,
                static_cast<std::uint32_t>(view));
  return picture_;
}

void Exposure::backward(const Buffer<float>& image,
                        Buffer<float>& gradient,
                        std::size_t view,
                        int width,
                        int height,
                        std::size_t slot) {
  const std::uint32_t pixels = pixels_of(width, height);
  const std::size_t blocks = (pixels + kBlock - 1) / kBlock;
  partials_.ensure(context_, kNumbers * blocks, "exposure sums");
  gradient_.launch(Range::linear(blocks, kGroup), image, deltas_, gradient, partials_, pixels,
                   static_cast<std::uint32_t>(view));
  sum_.launch(Range::linear(kNumbers, kNumbers), partials_, sums_,
              static_cast<std::uint32_t>(blocks), static_cast<std::uint32_t>(slot));
}

void Exposure::step(std::size_t view,
                    std::size_t slot,
                    double rate,
                    const Buffer<std::uint32_t>& guard) {
  step_.launch(Range::linear(kNumbers, kNumbers), sums_, guard, deltas_, first_, second_, steps_,
               static_cast<std::uint32_t>(slot), static_cast<std::uint32_t>(views_),
               static_cast<std::uint32_t>(view), static_cast<float>(rate), kBeta1, kBeta2,
               kEpsilon);
}

Exposure::State Exposure::state() const {
  return {deltas_.download(), first_.download(), second_.download(), steps_.download()};
}

void Exposure::restore(const State& state) {
  for (const std::vector<float>* part :
       {&state.deltas, &state.first, &state.second, &state.steps}) {
    if (part->size() == kNumbers * views_) continue;
    throw DataError(
        fmt::format("The exposures to go on with are {} numbers, but {} photos have {}: resume "
                    "with the data of "
                    "the run",
                    part->size(), views_, kNumbers * views_));
  }
  deltas_.upload(state.deltas);
  first_.upload(state.first);
  second_.upload(state.second);
  steps_.upload(state.steps);
}

}  // namespace raysplats
