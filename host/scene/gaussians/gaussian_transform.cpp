// SPDX-License-Identifier: Apache-2.0
#include "scene/gaussians/gaussian_transform.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cfloat>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "raysplats/error.hpp"

#define RS_SH_REAL double
#include "shared/sh.h"

namespace raysplats {
namespace {

constexpr int kMaxDegree = 4;
/// Deviation from a rotation times a number up to which the axes keep their order.
constexpr double kSimilarity = 1e-9;
/// Smallest ratio of least to greatest extent of the image of the unit ball.
constexpr double kFlat = 1e-9;

double frobenius(const glm::dmat3& m) {
  return std::sqrt(glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2]));
}

void check(const glm::dmat4& map) {
  bool good = map[0][3] == 0.0 && map[1][3] == 0.0 && map[2][3] == 0.0 && map[3][3] == 1.0;
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) good = good && std::isfinite(map[column][row]);
  }
  if (!good) {
    throw UsageError(
        "Gaussians cannot be moved by a matrix that is not finite or whose last row is not "
        "0 0 0 1: give an affine map");
  }
  const glm::dmat3 linear(map);
  const double norm = frobenius(linear);
  if (!(std::abs(glm::determinant(linear)) > kFlat * norm * norm * norm)) {
    throw UsageError(
        "Gaussians cannot be moved by a matrix that flattens space: use scales other than zero");
  }
}

glm::dmat3 rotation_of(const float* q) {
  return glm::mat3_cast(glm::normalize(glm::dquat(q[0], q[1], q[2], q[3])));
}

/// Turns pairs of columns until all are orthogonal: the columns of the result are the left singular
/// vectors times the singular values (one-sided Jacobi, Hestenes 1958). Exact for needles and discs
/// too, whose covariance would lose the small axes.
glm::dmat3 orthogonal_columns(glm::dmat3 m) {
  constexpr int kSweeps = 30;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    bool turned = false;
    for (const auto& [i, j] : {std::pair{0, 1}, std::pair{0, 2}, std::pair{1, 2}}) {
      const double a = glm::dot(m[i], m[i]);
      const double b = glm::dot(m[j], m[j]);
      const double c = glm::dot(m[i], m[j]);
      if (std::abs(c) <= 1e-15 * std::sqrt(a * b)) continue;
      turned = true;
      const double zeta = (b - a) / (2.0 * c);
      const double t = std::copysign(1.0, zeta) / (std::abs(zeta) + std::hypot(1.0, zeta));
      const double cosine = 1.0 / std::hypot(1.0, t);
      const double sine = cosine * t;
      const glm::dvec3 first = cosine * m[i] - sine * m[j];
      m[j] = sine * m[i] + cosine * m[j];
      m[i] = first;
    }
    if (!turned) break;
  }
  return m;
}

/// Rotation and standard deviations of the Gaussian whose covariance is m m^T.
void write_axes(const glm::dmat3& m, float* quaternion, float* log_scales) {
  glm::dmat3 axes = orthogonal_columns(m);
  for (int k = 0; k < 3; ++k) {
    const double length = std::max(glm::length(axes[k]), DBL_MIN);
    log_scales[k] = static_cast<float>(std::log(length));
    axes[k] /= length;
  }
  if (glm::determinant(axes) < 0.0) axes[2] = -axes[2];
  const glm::dquat q = glm::normalize(glm::quat_cast(axes));
  quaternion[0] = static_cast<float>(q.w);
  quaternion[1] = static_cast<float>(q.x);
  quaternion[2] = static_cast<float>(q.y);
  quaternion[3] = static_cast<float>(q.z);
}

void map_shapes(Gaussians& out, const glm::dmat3& linear, const glm::dmat3& orthogonal) {
  const double scale = std::cbrt(std::abs(glm::determinant(linear)));
  const bool similar = frobenius(linear - scale * orthogonal) <= kSimilarity * frobenius(linear);
  // A reflection is a rotation times -1, which no ellipsoid notices.
  const glm::dquat turn =
      glm::normalize(glm::quat_cast(glm::determinant(orthogonal) < 0.0 ? -orthogonal : orthogonal));
  const auto shift = static_cast<float>(std::log(scale));
  for (std::size_t i = 0; i < out.size(); ++i) {
    float* q = &out.quaternions[4 * i];
    float* s = &out.log_scales[3 * i];
    if (similar) {
      const glm::dquat turned = turn * glm::normalize(glm::dquat(q[0], q[1], q[2], q[3]));
      q[0] = static_cast<float>(turned.w);
      q[1] = static_cast<float>(turned.x);
      q[2] = static_cast<float>(turned.y);
      q[3] = static_cast<float>(turned.z);
      for (int k = 0; k < 3; ++k) s[k] += shift;
      continue;
    }
    // The largest scale is taken out first, so that nothing under- or overflows when squared.
    const double largest = std::max({s[0], s[1], s[2]});
    glm::dmat3 m = linear * rotation_of(q);
    for (int k = 0; k < 3; ++k) m[k] *= std::exp(std::max(s[k] - largest, -300.0));
    write_axes(m, q, s);
    for (int k = 0; k < 3; ++k) s[k] += static_cast<float>(largest);
  }
}

void map_colors(Gaussians& out, const glm::dmat3& orthogonal) {
  const auto stride = static_cast<std::size_t>(sh_coefficients(out.sh_degree));
  for (int degree = 1; degree <= out.sh_degree; ++degree) {
    const auto number = static_cast<std::size_t>(degree);
    const std::size_t first = number * number, size = 2 * number + 1;
    const std::vector<double> map = sh_band_map(degree, orthogonal);
    std::array<double, 2 * kMaxDegree + 1> band{};
    for (std::size_t i = 0; i < out.size(); ++i) {
      for (std::size_t channel = 0; channel < 3; ++channel) {
        float* sh = &out.sh[3 * (i * stride + first) + channel];
        for (std::size_t k = 0; k < size; ++k) band[k] = sh[3 * k];
        for (std::size_t k = 0; k < size; ++k) {
          double sum = 0.0;
          for (std::size_t j = 0; j < size; ++j) sum += map[k * size + j] * band[j];
          sh[3 * k] = static_cast<float>(sum);
        }
      }
    }
  }
}

}  // namespace

glm::dmat3 orthogonal_factor(const glm::dmat3& matrix) {
  glm::dmat3 q = matrix;
  constexpr int kSteps = 100;
  for (int step = 0; step < kSteps; ++step) {
    const glm::dmat3 inverse = glm::transpose(glm::inverse(q));
    // Far from a rotation the weighted step halves the number of iterations (Higham's gamma).
    const double gamma = std::sqrt(frobenius(inverse) / frobenius(q));
    const glm::dmat3 next = 0.5 * (gamma * q + inverse / gamma);
    const double change = frobenius(next - q);
    q = next;
    if (change <= 1e-15 * frobenius(q)) break;
  }
  return q;
}

std::vector<double> sh_band_map(int degree, const glm::dmat3& orthogonal) {
  // The band's functions at more directions than it has, before and after the map; least squares
  // gives the matrix between both, which is exact because orthogonal maps keep a band to itself.
  constexpr int kDirections = 64;
  const auto number = static_cast<std::size_t>(degree);
  const std::size_t first = number * number, size = 2 * number + 1;
  std::vector<double> gram(size * size, 0.0);
  std::vector<double> map(size * size, 0.0);
  std::array<double, sh_coefficients(kMaxDegree)> at{}, before{};
  for (int k = 0; k < kDirections; ++k) {
    // Points of a spiral over the sphere.
    const double z = 1.0 - (2.0 * k + 1.0) / kDirections;
    const double angle = k * std::numbers::pi * (3.0 - std::sqrt(5.0));
    const double ring = std::sqrt(1.0 - z * z);
    const glm::dvec3 n(ring * std::cos(angle), ring * std::sin(angle), z);
    const glm::dvec3 source = glm::transpose(orthogonal) * n;
    rs_sh_basis(degree, n.x, n.y, n.z, at.data());
    rs_sh_basis(degree, source.x, source.y, source.z, before.data());
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) {
        gram[i * size + j] += at[first + i] * at[first + j];
        map[i * size + j] += at[first + i] * before[first + j];
      }
    }
  }
  // Gauss and Jordan; the matrix is symmetric and close to a multiple of one, so its own diagonal
  // is a good pivot.
  for (std::size_t pivot = 0; pivot < size; ++pivot) {
    const double scale = 1.0 / gram[pivot * size + pivot];
    for (std::size_t j = 0; j < size; ++j) {
      gram[pivot * size + j] *= scale;
      map[pivot * size + j] *= scale;
    }
    for (std::size_t i = 0; i < size; ++i) {
      if (i == pivot) continue;
      const double factor = gram[i * size + pivot];
      for (std::size_t j = 0; j < size; ++j) {
        gram[i * size + j] -= factor * gram[pivot * size + j];
        map[i * size + j] -= factor * map[pivot * size + j];
      }
    }
  }
  return map;
}

Gaussians transformed(Gaussians model, const glm::dmat4& map) {
  check(map);
  if (map == glm::dmat4(1.0)) return model;
  const glm::dmat3 linear(map);
  const glm::dvec3 offset(map[3]);
  const glm::dmat3 orthogonal = orthogonal_factor(linear);
  for (std::size_t i = 0; i < model.size(); ++i) {
    float* m = &model.means[3 * i];
    const glm::dvec3 mean = linear * glm::dvec3(m[0], m[1], m[2]) + offset;
    if (std::max({std::abs(mean.x), std::abs(mean.y), std::abs(mean.z)}) > FLT_MAX) {
      throw UsageError(fmt::format(
          "Gaussian {} would be moved to {:.6g}, {:.6g}, {:.6g}, beyond what 32-bit numbers hold: "
          "use a smaller scale or translation",
          i, mean.x, mean.y, mean.z));
    }
    for (int k = 0; k < 3; ++k) m[k] = static_cast<float>(mean[k]);
  }
  map_shapes(model, linear, orthogonal);
  if (orthogonal != glm::dmat3(1.0)) map_colors(model, orthogonal);
  return model;
}

SkyLight transformed(const SkyLight& light, const glm::dmat4& map) {
  if (light.empty() || map == glm::dmat4(1.0)) return light;
  check(map);
  const glm::dmat3 orthogonal = orthogonal_factor(glm::dmat3(map));
  SkyLight out = light;
  for (std::size_t degree = 1; degree * degree < light.size(); ++degree) {
    const std::size_t first = degree * degree, size = 2 * degree + 1;
    const std::vector<double> turn = sh_band_map(static_cast<int>(degree), orthogonal);
    for (std::size_t k = 0; k < size; ++k) {
      for (std::size_t c = 0; c < 3; ++c) {
        double sum = 0.0;
        for (std::size_t j = 0; j < size; ++j)
          sum += turn[k * size + j] * static_cast<double>(light[first + j][c]);
        out[first + k][c] = static_cast<float>(sum);
      }
    }
  }
  return out;
}

Gaussians joined(std::span<const Gaussians> models) {
  Gaussians out;
  for (const Gaussians& model : models) out.sh_degree = std::max(out.sh_degree, model.sh_degree);
  const auto append = [](std::vector<float>& to, const std::vector<float>& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  for (const Gaussians& model : models) {
    append(out.means, model.means);
    append(out.quaternions, model.quaternions);
    append(out.log_scales, model.log_scales);
    append(out.opacities, model.opacities);
    append(out.sh,
           model.sh_degree == out.sh_degree ? model.sh : with_sh_degree(model, out.sh_degree).sh);
  }
  return out;
}

}  // namespace raysplats
