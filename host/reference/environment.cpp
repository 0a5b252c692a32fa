// SPDX-License-Identifier: Apache-2.0
#include "reference/environment.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "reference/gaussian.hpp"

namespace raysplats::reference {
namespace {

constexpr double kPi = std::numbers::pi;

int wrapped(int i, int n) { return ((i % n) + n) % n; }

/// A vector turned about a unit axis by the right hand (Rodrigues).
glm::dvec3 turned(const glm::dvec3& v, const glm::dvec3& axis, double angle) {
  return v * std::cos(angle) + glm::cross(axis, v) * std::sin(angle) +
         axis * glm::dot(axis, v) * (1.0 - std::cos(angle));
}

}  // namespace

glm::dvec3 sampled(const Image& image, double x, double y, bool repeat_y) {
  const double px = x * image.width - 0.5;
  const double py = y * image.height - 0.5;
  const double x0 = std::floor(px);
  const double y0 = std::floor(py);
  glm::dvec3 out(0.0);
  for (int dy = 0; dy < 2; ++dy) {
    for (int dx = 0; dx < 2; ++dx) {
      const double weight =
          (dx == 1 ? px - x0 : 1.0 - (px - x0)) * (dy == 1 ? py - y0 : 1.0 - (py - y0));
      const int row = static_cast<int>(y0) + dy;
      const int column = wrapped(static_cast<int>(x0) + dx, image.width);
      const int held = repeat_y ? wrapped(row, image.height) : std::clamp(row, 0, image.height - 1);
      for (int c = 0; c < 3; ++c) out[c] += weight * image.at(column, held, c);
    }
  }
  return out;
}

EnvironmentLight::EnvironmentLight(const Environment& environment) : environment_(environment) {
  const glm::dvec3 up =
      glm::normalize(glm::dvec3(environment.up[0], environment.up[1], environment.up[2]));
  const glm::dvec3 towards = std::abs(up.z) < 0.999 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
  const glm::dvec3 forward = turned(glm::normalize(towards - up * glm::dot(up, towards)), up,
                                    environment.rotation * kPi / 180.0);
  axes_ = glm::dmat3(glm::cross(forward, up), up, forward);

  // Ramamoorthi and Hanrahan 2001, eq. 10: the picture's projection on the harmonics up to degree
  // 2; every texel is constant and is sampled densely.
  const Image& image = environment_.equirect;
  if (image.data.empty()) return;
  constexpr int kFine = 4;
  const int rows = kFine * image.height;
  const int columns = kFine * image.width;
  for (int row = 0; row < rows; ++row) {
    const double top = kPi * row / rows;
    const double bottom = kPi * (row + 1) / rows;
    const double polar = 0.5 * (top + bottom);
    const double solid_angle = 2.0 * kPi / columns * (std::cos(top) - std::cos(bottom));
    for (int column = 0; column < columns; ++column) {
      const double azimuth = 2.0 * kPi * ((column + 0.5) / columns - 0.5);
      const glm::dvec3 direction =
          axes_ * glm::dvec3(std::sin(polar) * std::sin(azimuth), std::cos(polar),
                             std::sin(polar) * std::cos(azimuth));
      const auto basis = sh_basis(2, direction);
      for (std::size_t k = 0; k < 9; ++k) {
        for (int c = 0; c < 3; ++c) {
          coefficients_[k][c] += solid_angle * basis[k] * image.at(column / kFine, row / kFine, c);
        }
      }
    }
  }
}

glm::dvec3 EnvironmentLight::seen(const glm::dvec3& direction) const {
  const glm::dvec3 factor(environment_.color[0], environment_.color[1], environment_.color[2]);
  if (environment_.equirect.data.empty()) return factor;
  const glm::dvec3 local = glm::transpose(axes_) * direction;
  const double x = 0.5 + std::atan2(local.x, local.z) / (2.0 * kPi);
  const double y = std::acos(std::clamp(local.y, -1.0, 1.0)) / kPi;
  return factor * sampled(environment_.equirect, x, y, false);
}

glm::dvec3 EnvironmentLight::on_normal(const glm::dvec3& normal) const {
  const glm::dvec3 factor(environment_.color[0], environment_.color[1], environment_.color[2]);
  if (environment_.equirect.data.empty()) return factor;
  // Eq. 8 divided by pi: the clamped cosine's coefficients are pi, 2 pi / 3 and pi / 4.
  const auto basis = sh_basis(2, normal);
  glm::dvec3 out(0.0);
  for (std::size_t k = 0; k < 9; ++k) {
    out += (k == 0 ? 1.0 : k < 4 ? 2.0 / 3.0 : 0.25) * basis[k] * coefficients_[k];
  }
  return factor * glm::max(out, glm::dvec3(0.0));
}

}  // namespace raysplats::reference
