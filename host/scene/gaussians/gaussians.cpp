// SPDX-License-Identifier: Apache-2.0
#include "raysplats/gaussians.hpp"

#include <algorithm>

#include "scene/gaussians/gaussian_check.hpp"

namespace raysplats {

void Gaussians::resize(std::size_t count) {
  const std::size_t before = size();
  means.resize(3 * count);
  quaternions.resize(4 * count);
  log_scales.resize(3 * count);
  opacities.resize(count);
  sh.resize(3 * count * static_cast<std::size_t>(sh_coefficients(sh_degree)));
  for (std::size_t i = before; i < count; ++i) quaternions[4 * i] = 1.0f;
}

Gaussians with_sh_degree(const Gaussians& model, int degree) {
  check_sizes(model);
  check_sh_degree(degree);
  Gaussians out = model;
  const auto from = 3 * static_cast<std::size_t>(sh_coefficients(model.sh_degree));
  const auto to = 3 * static_cast<std::size_t>(sh_coefficients(degree));
  out.sh_degree = degree;
  out.sh.assign(model.size() * to, 0.0f);
  for (std::size_t i = 0; i < model.size(); ++i) {
    std::copy_n(model.sh.begin() + static_cast<std::ptrdiff_t>(i * from), std::min(from, to),
                out.sh.begin() + static_cast<std::ptrdiff_t>(i * to));
  }
  return out;
}

}  // namespace raysplats
