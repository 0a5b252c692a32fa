// SPDX-License-Identifier: Apache-2.0
#include "reference/gaussian.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/matrix.hpp>
#include <numbers>

#include "raysplats/error.hpp"
#include "reference/scenes.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::reference;

namespace {

/// K_l^m P_l^|m|(cos theta) times cos or sin of m phi, from the definition with Condon-Shortley
/// phase.
double sh_by_definition(int l, int m, double theta, double phi) {
  const int a = std::abs(m);
  double factorials = 1.0;
  for (int k = l - a + 1; k <= l + a; ++k) factorials *= k;
  const double k = std::sqrt((2.0 * l + 1.0) / (4.0 * std::numbers::pi * factorials));
  // std::assoc_legendre leaves the phase out.
  const double p =
      std::assoc_legendre(static_cast<unsigned>(l), static_cast<unsigned>(a), std::cos(theta));
  const double phase = a % 2 == 0 ? 1.0 : -1.0;
  if (m == 0) return k * p;
  return phase * std::sqrt(2.0) * k * p * (m > 0 ? std::cos(a * phi) : std::sin(a * phi));
}

}  // namespace

TEST_CASE("the SH basis is the definition's with the signs of Sloan 2008") {
  CounterRng rng(1, 2);
  for (int n = 0; n < 50; ++n) {
    const double theta = std::acos(2.0 * rng.uniform() - 1.0),
                 phi = 2.0 * std::numbers::pi * rng.uniform();
    const glm::dvec3 d(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                       std::cos(theta));
    const auto basis = sh_basis(4, d);
    for (int l = 0; l <= 4; ++l) {
      for (int m = -l; m <= l; ++m) {
        const auto i = static_cast<std::size_t>(l * l + l + m);
        CHECK(basis[i] == doctest::Approx(sh_by_definition(l, m, theta, phi)).epsilon(1e-9));
      }
    }
  }
}

TEST_CASE("the SH basis has the constants of the 3DGS family") {
  const auto basis = sh_basis(4, {1.0, 0.0, 0.0});
  CHECK(basis[0] == doctest::Approx(0.28209479177387814));
  CHECK(basis[3] == doctest::Approx(-0.4886025119029199));
  CHECK(basis[8] == doctest::Approx(0.5462742152960396));
  CHECK(basis[15] == doctest::Approx(-0.5900435899266435));
  CHECK(basis[24] == doctest::Approx(0.6258357354491761));
  const auto low = sh_basis(1, {1.0, 0.0, 0.0});
  for (std::size_t i = 4; i < 25; ++i) CHECK(low[i] == 0.0);
}

TEST_CASE("the whitening matrix undoes the covariance") {
  const Gaussians model = random_scene(20, 3, 0);
  for (const ScaleActivation activation : {ScaleActivation::kExp, ScaleActivation::kSigmoid}) {
    Gaussians small = model;
    for (float& s : small.log_scales) s -= 3.0f;
    const Parameters p(small, activation);
    for (std::size_t i = 0; i < p.size(); ++i) {
      // M Sigma M^T = 1 with Sigma from the textbook's rotation matrix.
      double q[4], n = 0.0;
      for (std::size_t k = 0; k < 4; ++k) n += p.quaternions[4 * i + k] * p.quaternions[4 * i + k];
      for (std::size_t k = 0; k < 4; ++k) q[k] = p.quaternions[4 * i + k] / std::sqrt(n);
      const auto [r, x, y, z] = q;
      const glm::dmat3 rotation = glm::transpose(
          glm::dmat3(1 - 2 * (y * y + z * z), 2 * (x * y - r * z), 2 * (x * z + r * y),
                     2 * (x * y + r * z), 1 - 2 * (x * x + z * z), 2 * (y * z - r * x),
                     2 * (x * z - r * y), 2 * (y * z + r * x), 1 - 2 * (x * x + y * y)));
      glm::dmat3 scaled = rotation;
      for (int k = 0; k < 3; ++k) {
        scaled[k] *=
            std::exp(static_cast<double>(small.log_scales[3 * i + static_cast<std::size_t>(k)]));
      }
      const glm::dmat3 m = whitening_matrix(p, i);
      const glm::dmat3 one = m * scaled * glm::transpose(scaled) * glm::transpose(m);
      for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b)
          CHECK(one[a][b] == doctest::Approx(a == b ? 1.0 : 0.0).epsilon(1e-9));
      }
    }
  }
}

TEST_CASE("a scale without a sigmoid parameter is refused") {
  Gaussians model = random_scene(1, 1, 0);
  model.log_scales[1] = 0.5f;
  CHECK_THROWS_AS(Parameters(model, ScaleActivation::kSigmoid), UsageError);
}

TEST_CASE("the flat accessor reaches every scalar once") {
  Parameters p(random_scene(3, 1, 2));
  CHECK(p.scalar_count() == 3 * (3 + 4 + 3 + 1 + 27));
  for (std::size_t i = 0; i < p.scalar_count(); ++i) p.at(i) = static_cast<double>(i);
  CHECK(p.means[4] == 4.0);
  CHECK(p.quaternions[0] == 9.0);
  CHECK(p.scales[0] == 21.0);
  CHECK(p.opacities[2] == 32.0);
  CHECK(p.sh[80] == 113.0);
}

TEST_CASE("colours are clamped below and bands above the active degree are silent") {
  Parameters p(random_scene(1, 1, 1));
  std::fill(p.sh.begin(), p.sh.end(), 0.0);
  p.sh[0] = -10.0;
  p.sh[3 * 2 + 1] = 1.0;  // z band of green
  CHECK(color(p, 0, {0, 0, 1}).r == 0.0);
  CHECK(color(p, 0, {0, 0, 1}).g == doctest::Approx(0.5 + 0.4886025119029199));
  p.active_sh_degree = 0;
  CHECK(color(p, 0, {0, 0, 1}).g == 0.5);
}
