// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/sky_adam.hpp"

#include <fmt/format.h>

#include "raysplats/error.hpp"
#include "shared/sh.h"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;
constexpr float kBeta1 = 0.9f;
constexpr float kBeta2 = 0.999f;
constexpr float kEpsilon = 1e-15f;

}  // namespace

SkyAdam::SkyAdam(Context& context, std::size_t numbers)
    : step_(context.kernel("train/sky_adam.cl", "sky_step")) {
  for (Buffer<float>* buffer : {&first_, &second_, &steps_}) {
    *buffer = Buffer<float>(context, numbers, "optimiser of the sky");
    buffer->clear();
  }
}

void SkyAdam::step(const Buffer<float>& gradient,
                   const Buffer<float>& coefficients,
                   double rate,
                   const Buffer<std::uint32_t>& guard) {
  step_.launch(Range::linear(first_.size(), kGroup), gradient, guard, coefficients, first_, second_,
               steps_, static_cast<std::uint32_t>(first_.size()), static_cast<float>(rate), kBeta1,
               kBeta2, kEpsilon);
}

SkyAdam::State SkyAdam::state() const {
  return {first_.download(), second_.download(), steps_.download()};
}

void SkyAdam::restore(const State& state) {
  for (const std::vector<float>* part : {&state.first, &state.second, &state.steps}) {
    if (part->size() == first_.size()) continue;
    throw DataError(fmt::format(
        "The sky to go on with has {} numbers, not {}: resume with the 'sky-degree' of the run",
        part->size(), first_.size()));
  }
  first_.upload(state.first);
  second_.upload(state.second);
  steps_.upload(state.steps);
}

SkyLight even_sky(int degree, const std::array<float, 3>& color) {
  SkyLight out(static_cast<std::size_t>((degree + 1) * (degree + 1)));
  float basis = 0;
  rs_sh_basis(0, 0.0f, 0.0f, 1.0f, &basis);
  for (std::size_t c = 0; c < 3; ++c) out[0][c] = (color[c] - 0.5f) / basis;
  return out;
}

}  // namespace raysplats
