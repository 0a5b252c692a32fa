// SPDX-License-Identifier: Apache-2.0
#include "reference/gaussian.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "raysplats/error.hpp"

namespace raysplats::reference {
namespace {

/// A value with its derivatives by x, y and z.
struct Dual {
  double value = 0.0;
  glm::dvec3 slope{0.0};

  Dual() = default;
  Dual(double v) : value(v) {}
  Dual(double v, const glm::dvec3& s) : value(v), slope(s) {}
};

Dual operator+(const Dual& a, const Dual& b) { return {a.value + b.value, a.slope + b.slope}; }
Dual operator-(const Dual& a, const Dual& b) { return {a.value - b.value, a.slope - b.slope}; }
Dual operator*(const Dual& a, const Dual& b) {
  return {a.value * b.value, a.value * b.slope + b.value * a.slope};
}

/// The basis for any number type, with the normalisation constants written out as square roots.
template <typename T>
std::array<T, 25> basis_of(int degree, const T& x, const T& y, const T& z) {
  const auto c = [](double numerator, double denominator) {
    return T(std::sqrt(numerator / (denominator * std::numbers::pi)));
  };
  const T one(1.0), two(2.0), three(3.0), four(4.0), seven(7.0);
  const T xx = x * x, yy = y * y, zz = z * z;
  std::array<T, 25> out{};
  out[0] = c(1, 4);
  if (degree >= 1) {
    out[1] = T(-1.0) * c(3, 4) * y;
    out[2] = c(3, 4) * z;
    out[3] = T(-1.0) * c(3, 4) * x;
  }
  if (degree >= 2) {
    out[4] = c(15, 4) * x * y;
    out[5] = T(-1.0) * c(15, 4) * y * z;
    out[6] = c(5, 16) * (two * zz - xx - yy);
    out[7] = T(-1.0) * c(15, 4) * x * z;
    out[8] = c(15, 16) * (xx - yy);
  }
  if (degree >= 3) {
    out[9] = T(-1.0) * c(35, 32) * y * (three * xx - yy);
    out[10] = c(105, 4) * x * y * z;
    out[11] = T(-1.0) * c(21, 32) * y * (four * zz - xx - yy);
    out[12] = c(7, 16) * z * (two * zz - three * xx - three * yy);
    out[13] = T(-1.0) * c(21, 32) * x * (four * zz - xx - yy);
    out[14] = c(105, 16) * z * (xx - yy);
    out[15] = T(-1.0) * c(35, 32) * x * (xx - three * yy);
  }
  if (degree >= 4) {
    out[16] = c(315, 16) * x * y * (xx - yy);
    out[17] = T(-1.0) * c(315, 32) * y * z * (three * xx - yy);
    out[18] = c(45, 16) * x * y * (seven * zz - one);
    out[19] = T(-1.0) * c(45, 32) * y * z * (seven * zz - three);
    out[20] = c(9, 256) * (zz * (T(35.0) * zz - T(30.0)) + three);
    out[21] = T(-1.0) * c(45, 32) * x * z * (seven * zz - three);
    out[22] = c(45, 64) * (xx - yy) * (seven * zz - one);
    out[23] = T(-1.0) * c(315, 32) * x * z * (xx - three * yy);
    out[24] = c(315, 256) * (xx * (xx - three * yy) - yy * (three * xx - yy));
  }
  return out;
}

template <typename P>
auto& scalar(P& p, std::size_t flat) {
  for (auto* group : {&p.means, &p.quaternions, &p.scales, &p.opacities}) {
    if (flat < group->size()) return (*group)[flat];
    flat -= group->size();
  }
  return p.sh.at(flat);
}

}  // namespace

Parameters::Parameters(const Gaussians& model, ScaleActivation scale_activation)
    : sh_degree(model.sh_degree),
      active_sh_degree(model.sh_degree),
      activation(scale_activation),
      means(model.means.begin(), model.means.end()),
      quaternions(model.quaternions.begin(), model.quaternions.end()),
      scales(model.log_scales.begin(), model.log_scales.end()),
      opacities(model.opacities.begin(), model.opacities.end()),
      sh(model.sh.begin(), model.sh.end()) {
  if (activation != ScaleActivation::kSigmoid) return;
  for (double& s : scales) {
    if (s >= 0.0) {
      throw UsageError("a scale of 1 or more has no sigmoid parameter, shrink the scene");
    }
    s -= std::log1p(-std::exp(s));
  }
}

std::size_t Parameters::scalar_count() const {
  return means.size() + quaternions.size() + scales.size() + opacities.size() + sh.size();
}

double& Parameters::at(std::size_t flat) { return scalar(*this, flat); }
double Parameters::at(std::size_t flat) const { return scalar(*this, flat); }

Parameters Parameters::zeros() const {
  Parameters out = *this;
  for (auto* group : {&out.means, &out.quaternions, &out.scales, &out.opacities, &out.sh}) {
    std::fill(group->begin(), group->end(), 0.0);
  }
  return out;
}

double sigmoid(double x) { return 1.0 / (1.0 + std::exp(-x)); }

double activated_scale(double parameter, ScaleActivation activation) {
  return activation == ScaleActivation::kSigmoid ? sigmoid(parameter) : std::exp(parameter);
}

glm::dmat3 rotation_matrix(const std::array<double, 4>& quaternion) {
  const double r = quaternion[0];
  const glm::dvec3 u(quaternion[1], quaternion[2], quaternion[3]);
  const double n = r * r + glm::dot(u, u);
  // Columns are the images of the axes: x -> x + 2 (r (u x x) + u x (u x x)) / n.
  glm::dmat3 out(1.0);
  for (int k = 0; k < 3; ++k) {
    const glm::dvec3 w = glm::cross(u, out[k]);
    out[k] += (2.0 / n) * (r * w + glm::cross(u, w));
  }
  return out;
}

glm::dmat3 whitening_matrix(const Parameters& p, std::size_t i) {
  glm::dmat3 rotation = rotation_matrix({p.quaternions[4 * i], p.quaternions[4 * i + 1],
                                         p.quaternions[4 * i + 2], p.quaternions[4 * i + 3]});
  for (int k = 0; k < 3; ++k) {
    rotation[k] /= activated_scale(p.scales[3 * i + static_cast<std::size_t>(k)], p.activation);
  }
  return glm::transpose(rotation);
}

double effective_quantile(const TraceOptions& options, double opacity) {
  const double q = options.quantile;
  if (!options.adaptive_radius) return q;
  if (opacity < 1.0 / 255.0) return -1.0;
  return std::min(q, 2.0 * std::log(255.0 * opacity));
}

std::array<double, 25> sh_basis(int degree, const glm::dvec3& d) {
  return basis_of<double>(degree, d.x, d.y, d.z);
}

std::array<glm::dvec3, 25> sh_basis_gradient(int degree, const glm::dvec3& d) {
  const auto duals =
      basis_of<Dual>(degree, Dual(d.x, {1, 0, 0}), Dual(d.y, {0, 1, 0}), Dual(d.z, {0, 0, 1}));
  std::array<glm::dvec3, 25> out{};
  std::transform(duals.begin(), duals.end(), out.begin(), [](const Dual& b) { return b.slope; });
  return out;
}

glm::dvec3 color(const Parameters& p, std::size_t i, const glm::dvec3& direction) {
  const auto stride = static_cast<std::size_t>(sh_coefficients(p.sh_degree));
  const int degree = std::min(p.sh_degree, p.active_sh_degree);
  const auto basis = sh_basis(degree, direction);
  glm::dvec3 out(0.5);
  for (std::size_t k = 0; k < static_cast<std::size_t>(sh_coefficients(degree)); ++k) {
    const double* coefficient = &p.sh[3 * (i * stride + k)];
    out += basis[k] * glm::dvec3(coefficient[0], coefficient[1], coefficient[2]);
  }
  return glm::max(out, glm::dvec3(0.0));
}

}  // namespace raysplats::reference
