// SPDX-License-Identifier: Apache-2.0
#include "train/density/mcmc.hpp"

#include "train/schedule.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

constexpr char kProgram[] = "train/mcmc.cl";
constexpr std::size_t kGroup = 64;
constexpr std::uint64_t kNoiseStream = 0x6e6f697365;

Kernel kernel(Context& context, const char* name, const DeviceGaussians& gaussians) {
  BuildOptions build;
  build.define("SIGMOID_SCALE", gaussians.activation == ScaleActivation::kSigmoid ? 1 : 0);
  return context.kernel(kProgram, name, build);
}

}  // namespace

Mcmc::Mcmc(Context& context, const TrainOptions& options, double length)
    : context_(context), options_(options), length_(length) {}

void Mcmc::add_regularisation(const DeviceGaussians& gaussians,
                              GaussianGradients& gradients,
                              const Buffer<std::uint32_t>& guard) {
  // The gradients are sums over views, each of which has the regularisers in its loss.
  const double count = static_cast<double>(gaussians.count) / options_.views_per_step;
  kernel(context_, "mcmc_press", gaussians)
      .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
              static_cast<float>(options_.opacity_reg / count),
              static_cast<float>(options_.scale_reg / (3.0 * count * length_)), guard,
              gaussians.opacities, gaussians.scales, gradients.opacities, gradients.scales);
}

void Mcmc::add_noise(DeviceGaussians& gaussians,
                     std::int64_t iteration,
                     const Buffer<std::uint32_t>& guard) {
  const LearningRate rate = position_rate(options_);
  if (options_.mcmc_noise <= 0 || rate.initial <= 0) return;
  const double decay = learning_rate(rate, options_, iteration) / rate.initial;
  const std::uint64_t key =
      CounterRng(options_.seed, kNoiseStream, static_cast<std::uint64_t>(iteration)).bits();
  kernel(context_, "mcmc_noise", gaussians)
      .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
              static_cast<std::uint32_t>(key), static_cast<std::uint32_t>(key >> 32),
              static_cast<float>(options_.mcmc_noise * decay / length_), guard,
              gaussians.quaternions, gaussians.scales, gaussians.opacities, gaussians.means);
  gaussians.changed(context_);
}

void apply_shares(Context& context,
                  std::span<const std::array<float, 2>> shares,
                  DeviceGaussians& gaussians) {
  Buffer<std::array<float, 2>> device(context, shares.size(), "shares of Gaussians");
  device.upload(shares);
  kernel(context, "mcmc_share", gaussians)
      .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
              device, gaussians.opacities, gaussians.scales);
  gaussians.changed(context);
}

}  // namespace raysplats
