// SPDX-License-Identifier: Apache-2.0
#include "scene/gaussians/gaussian_selection.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "scene/gaussians/activation.hpp"

namespace raysplats {
namespace {

template <class Keep>
std::vector<std::uint32_t> kept(const Gaussians& model, Keep keep) {
  std::vector<std::uint32_t> indices;
  for (std::uint32_t i = 0; i < model.size(); ++i) {
    if (keep(i)) indices.push_back(i);
  }
  return indices;
}

}  // namespace

Gaussians gathered(const Gaussians& model, std::span<const std::uint32_t> indices) {
  Gaussians out;
  out.sh_degree = model.sh_degree;
  out.resize(indices.size());
  const auto copy = [&](const std::vector<float>& from, std::vector<float>& to, std::size_t width) {
    for (std::size_t i = 0; i < indices.size(); ++i) {
      std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(indices[i] * width), width,
                  to.begin() + static_cast<std::ptrdiff_t>(i * width));
    }
  };
  copy(model.means, out.means, 3);
  copy(model.quaternions, out.quaternions, 4);
  copy(model.log_scales, out.log_scales, 3);
  copy(model.opacities, out.opacities, 1);
  copy(model.sh, out.sh, 3 * static_cast<std::size_t>(sh_coefficients(model.sh_degree)));
  return out;
}

std::vector<std::uint32_t> within(const Gaussians& model, const Bounds& box) {
  return kept(model, [&](std::uint32_t i) {
    const float* mean = &model.means[3 * std::size_t{i}];
    return box.contains(mean[0], mean[1], mean[2]);
  });
}

std::vector<std::uint32_t> with_opacity(const Gaussians& model, double least) {
  return kept(model, [&](std::uint32_t i) {
    return sigmoid(static_cast<double>(model.opacities[i])) >= least;
  });
}

std::vector<double> sections(const Gaussians& model) {
  std::vector<double> out(model.size());
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float* s = &model.log_scales[3 * i];
    // Of the two longer axes; logarithms, which do not overflow.
    const double area = static_cast<double>(s[0]) + static_cast<double>(s[1]) +
                        static_cast<double>(s[2]) -
                        static_cast<double>(std::min({s[0], s[1], s[2]}));
    out[i] = area - std::log1p(std::exp(-static_cast<double>(model.opacities[i])));
  }
  return out;
}

std::vector<std::uint32_t> largest(std::span<const double> weights, std::size_t most) {
  std::vector<std::uint32_t> order(weights.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return weights[a] > weights[b]; });
  order.resize(std::min(most, order.size()));
  std::sort(order.begin(), order.end());
  return order;
}

}  // namespace raysplats
