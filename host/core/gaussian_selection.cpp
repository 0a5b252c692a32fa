// SPDX-License-Identifier: Apache-2.0
#include "core/gaussian_selection.hpp"

#include <algorithm>
#include <cmath>

namespace raysplats {
namespace {

template <class Keep>
Gaussians kept(const Gaussians& model, Keep keep) {
  std::vector<std::uint32_t> indices;
  for (std::uint32_t i = 0; i < model.size(); ++i) {
    if (keep(i)) indices.push_back(i);
  }
  return gathered(model, indices);
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
  copy(model.sh, out.sh, static_cast<std::size_t>(3 * sh_coefficients(model.sh_degree)));
  return out;
}

Gaussians within(const Gaussians& model, const CropBox& box) {
  return kept(model, [&](std::uint32_t i) {
    bool inside = true;
    for (int k = 0; k < 3; ++k) {
      const auto x =
          static_cast<double>(model.means[3 * std::size_t{i} + static_cast<std::size_t>(k)]);
      inside = inside && x >= box.low[k] && x <= box.high[k];
    }
    return inside;
  });
}

Gaussians with_opacity(const Gaussians& model, double least) {
  return kept(model, [&](std::uint32_t i) {
    return 1.0 / (1.0 + std::exp(-static_cast<double>(model.opacities[i]))) >= least;
  });
}

}  // namespace raysplats
