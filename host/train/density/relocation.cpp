// SPDX-License-Identifier: Apache-2.0
#include "train/density/relocation.hpp"

#include <algorithm>
#include <cmath>

#include "scene/gaussians/activation.hpp"
#include "scene/morton_order.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

constexpr std::uint64_t kDrawStream = 0x72656c6f63;
constexpr std::size_t kMostParts = 51;
constexpr double kLeastOpacity = 0.005, kMostOpacity = 1.0 - 1e-6;

}  // namespace

EqualShare equal_share(double opacity, std::size_t parts) {
  const std::size_t n = std::clamp<std::size_t>(parts, 1, kMostParts);
  const double part = 1.0 - std::pow(1.0 - opacity, 1.0 / static_cast<double>(n));
  // The double sum over i <= n and k < i of C(i - 1, k) (-1)^k part^(k + 1) / sqrt(k + 1), with the
  // sum over i taken: that of the first binomials C(i - 1, k - 1) up to n is C(n, k).
  double binomial = 1, power = 1, sum = 0;
  for (std::size_t k = 1; k <= n; ++k) {
    binomial *= static_cast<double>(n - k + 1) / static_cast<double>(k);
    power *= part;
    sum += (k % 2 == 1 ? 1 : -1) * binomial * power / std::sqrt(static_cast<double>(k));
  }
  return {std::clamp(part, kLeastOpacity, kMostOpacity), opacity / sum};
}

RelocationPlan plan_relocation(std::span<const float> means,
                               std::span<const float> scales,
                               std::span<const float> opacities,
                               const RelocationRules& rules) {
  const std::size_t count = opacities.size();
  RelocationPlan out;
  DensityPlan& plan = out.density;
  std::vector<double> upto(count);  // sum of the opacities of what is alive, up to each
  std::vector<std::uint32_t> parts(count, 0);
  double sum = 0;
  std::size_t alive = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double opacity = sigmoid(opacities[i]);
    std::size_t* const reason = !is_finite(means, scales, opacities, i) ? &plan.not_finite
                                : is_outside(rules.bounds, means, i)    ? &plan.outside
                                : !(opacity > rules.dead_opacity)       ? &plan.faint
                                                                        : nullptr;
    if (reason == nullptr) {
      sum += opacity;
      parts[i] = 1;
      ++alive;
    } else {
      ++*reason;
      ++plan.pruned;
    }
    upto[i] = sum;
  }
  if (alive == 0) return out;
  CounterRng rng(rules.seed, kDrawStream);
  for (std::size_t draw = alive; draw < std::max(rules.target, count); ++draw) {
    const auto found = std::upper_bound(upto.begin(), upto.end(), rng.uniform() * sum);
    std::size_t i = std::min(static_cast<std::size_t>(found - upto.begin()), count - 1);
    while (parts[i] == 0) --i;  // rounding may lead behind the last one alive
    ++parts[i];
    ++plan.cloned;
  }
  for (const std::uint32_t i : morton_order(means)) {
    if (parts[i] == 0) continue;
    const bool shared = parts[i] > 1;
    std::array<float, 2> share{};
    if (shared) {
      const EqualShare equal = equal_share(sigmoid(opacities[i]), parts[i]);
      share = {static_cast<float>(logit(equal.opacity)), static_cast<float>(equal.scale)};
    }
    const auto role = static_cast<std::uint32_t>(shared ? DensityRole::kPart : DensityRole::kKeep);
    plan.source.insert(plan.source.end(), parts[i], i);
    plan.role.insert(plan.role.end(), parts[i], role);
    out.shares.insert(out.shares.end(), parts[i], share);
  }
  return out;
}

}  // namespace raysplats
