// SPDX-License-Identifier: Apache-2.0
#include "reference/gradients.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>

#include "raysplats/error.hpp"
#include "reference/sky.hpp"
#include "scene/image/pixel_count.hpp"

namespace raysplats::reference {
namespace {

/// What one Gaussian receives from all rays of a view.
struct Sums {
  glm::dvec3 whitened{0.0};   ///< sum of g_o'
  glm::dmat3 whitening{0.0};  ///< dL/dM
  double opacity = 0.0;       ///< dL/d(logit)
  glm::dvec3 color{0.0};
};

/// Adds one ray's gradients to the sums of the Gaussians it met, and dL/do, dL/dd to the ray's own.
void backward_ray(const RayTrace& ray,
                  const std::vector<PreparedGaussian>& prepared,
                  const TraceOptions& options,
                  const glm::dvec3& origin,
                  const glm::dvec3& direction,
                  const glm::dvec3& color_gradient,
                  double alpha_gradient,
                  std::vector<Sums>& sums,
                  glm::dvec3& origin_gradient,
                  glm::dvec3& direction_gradient) {
  // Colour and alpha of everything behind the current hit, as if seen with full light.
  glm::dvec3 suffix_color = light_behind(options, direction);
  double suffix_alpha = 0.0;
  direction_gradient +=
      light_behind_gradient(options, direction, ray.transmittance * color_gradient);
  for (auto hit = ray.hits.rbegin(); hit != ray.hits.rend(); ++hit) {
    const PreparedGaussian& g = prepared[hit->index];
    Sums& sum = sums[hit->index];
    const double by_alpha =
        hit->transmittance * (glm::dot(color_gradient, hit->color - suffix_color) +
                              alpha_gradient * (1.0 - suffix_alpha));
    sum.color += hit->transmittance * hit->alpha * color_gradient;
    sum.opacity += by_alpha * hit->alpha * (1.0 - g.opacity);
    // d(alpha)/d(delta^2) = -alpha / 2 and d(delta^2) = 2 <v, do'> - 2 s <v, dd'>.
    const glm::dvec3 by_o = -by_alpha * hit->alpha * hit->residual;
    const glm::dvec3 by_d = -hit->slope * by_o;
    sum.whitened += by_o;
    sum.whitening += glm::outerProduct(by_o, origin - g.mean) + glm::outerProduct(by_d, direction);
    const glm::dmat3 transposed = glm::transpose(g.whitening);
    origin_gradient += transposed * by_o;
    direction_gradient += transposed * by_d;
    suffix_color = hit->alpha * hit->color + (1.0 - hit->alpha) * suffix_color;
    suffix_alpha = hit->alpha + (1.0 - hit->alpha) * suffix_alpha;
  }
}

/// Adds dL/dsh of Gaussian i from dL/dcolour; returns dL/d(mean - centre). `raises`: what raises a
/// clamped colour passes (TraceOptions::raise_clamped).
glm::dvec3 color_backward(const Parameters& p,
                          std::size_t i,
                          const glm::dvec3& offset,
                          glm::dvec3 color_gradient,
                          bool raises,
                          Parameters& out) {
  const double distance = glm::length(offset);
  if (!(distance > 0.0)) return glm::dvec3(0.0);
  const glm::dvec3 direction = offset / distance;
  const auto stride = static_cast<std::size_t>(sh_coefficients(p.sh_degree));
  const int degree = std::min(p.sh_degree, p.active_sh_degree);
  const auto basis = sh_basis(degree, direction);
  const auto basis_gradient = sh_basis_gradient(degree, direction);
  const glm::dvec3 clamped = color(p, i, direction);
  for (int k = 0; k < 3; ++k) {
    if (clamped[k] <= 0.0 && !(raises && color_gradient[k] < 0.0)) color_gradient[k] = 0.0;
  }
  glm::dvec3 by_direction(0.0);
  for (std::size_t b = 0; b < static_cast<std::size_t>(sh_coefficients(degree)); ++b) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double g = color_gradient[static_cast<int>(k)];
      out.sh[3 * (i * stride + b) + k] += g * basis[b];
      by_direction += g * p.sh[3 * (i * stride + b) + k] * basis_gradient[b];
    }
  }
  return (by_direction - direction * glm::dot(direction, by_direction)) / distance;
}

/// dL/dscale and dL/dquaternion of Gaussian i from dL/dM, M_kj = R_jk / s_k.
void whitening_backward(const Parameters& p,
                        std::size_t i,
                        const glm::dmat3& m,
                        const glm::dmat3& gradient,
                        Parameters& out) {
  const glm::dmat3 by_rows = glm::transpose(gradient);
  const glm::dmat3 rows = glm::transpose(m);
  glm::dmat3 by_rotation;
  for (int k = 0; k < 3; ++k) {
    const std::size_t at = 3 * i + static_cast<std::size_t>(k);
    const double scale = activated_scale(p.scales[at], p.activation);
    const double log_derivative = p.activation == ScaleActivation::kSigmoid ? 1.0 - scale : 1.0;
    out.scales[at] = -log_derivative * glm::dot(by_rows[k], rows[k]);
    by_rotation[k] = by_rows[k] / scale;
  }
  const auto q = quaternion_gradient({p.quaternions[4 * i], p.quaternions[4 * i + 1],
                                      p.quaternions[4 * i + 2], p.quaternions[4 * i + 3]},
                                     by_rotation);
  std::copy(q.begin(), q.end(), out.quaternions.begin() + static_cast<std::ptrdiff_t>(4 * i));
}

}  // namespace

std::array<double, 4> quaternion_gradient(const std::array<double, 4>& q,
                                          const glm::dmat3& gradient) {
  // Column k of R is e + (2 / n) f with f = r (u x e) + u x (u x e) and n = r^2 + u^2.
  const double r = q[0];
  const glm::dvec3 u(q[1], q[2], q[3]);
  const double n = r * r + glm::dot(u, u);
  double by_r = 0.0;
  double by_n = 0.0;
  glm::dvec3 by_u(0.0);
  for (int k = 0; k < 3; ++k) {
    glm::dvec3 e(0.0);
    e[k] = 1.0;
    const glm::dvec3& g = gradient[k];
    const glm::dvec3 w = glm::cross(u, e);
    by_r += 2.0 / n * glm::dot(g, w);
    by_u += 2.0 / n * (r * glm::cross(e, g) + glm::cross(w, g) + glm::cross(e, glm::cross(g, u)));
    by_n -= 2.0 / (n * n) * glm::dot(g, r * w + glm::cross(u, w));
  }
  by_r += 2.0 * r * by_n;
  by_u += 2.0 * by_n * u;
  return {by_r, by_u.x, by_u.y, by_u.z};
}

Gradient render_gradient(const Parameters& parameters,
                         const TraceOptions& options,
                         const Camera& camera,
                         std::span<const double> image_gradient) {
  const std::size_t pixels = pixel_count(camera);
  if (image_gradient.size() != 4 * pixels) {
    throw UsageError(
        "the image gradient does not have 4 planes of the camera's size, pass height x width x 4 "
        "numbers");
  }
  if (options.view_footprint > 0.0f) {
    throw UsageError(
        "the reference finds no gradient through a view's footprint, take differences of its "
        "pictures");
  }
  const auto prepared = prepare_view(parameters, options, camera);
  const glm::dmat3 to_world = glm::transpose(camera.rotation);
  const glm::dvec3 center = camera.center();
  Gradient out;
  out.parameters = parameters.zeros();
  std::vector<Sums> sums(parameters.size());
  std::size_t pixel = 0;
  for (int row = 0; row < camera.height; ++row) {
    for (int column = 0; column < camera.width; ++column, ++pixel) {
      const glm::dvec3 camera_direction = pixel_direction(camera, column, row);
      const glm::dvec3 direction = to_world * camera_direction;
      const RayTrace ray =
          trace_ray(parameters, prepared, options, center, direction, 0.0,
                    std::numeric_limits<double>::infinity(), ColorMode::kFromOrigin);
      const glm::dvec3 color_gradient(image_gradient[pixel], image_gradient[pixels + pixel],
                                      image_gradient[2 * pixels + pixel]);
      glm::dvec3 by_direction(0.0);
      backward_ray(ray, prepared, options, center, direction, color_gradient,
                   image_gradient[3 * pixels + pixel], sums, out.center, by_direction);
      // d = R^T exp(-[w]x) d_cam.
      out.rotation += glm::cross(camera.rotation * by_direction, camera_direction);
    }
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const glm::dvec3 by_offset =
        color_backward(parameters, i, prepared[i].mean - center, sums[i].color,
                       options.raise_clamped, out.parameters);
    whitening_backward(parameters, i, prepared[i].whitening, sums[i].whitening, out.parameters);
    const glm::dvec3 by_mean = by_offset - glm::transpose(prepared[i].whitening) * sums[i].whitened;
    for (int k = 0; k < 3; ++k)
      out.parameters.means[3 * i + static_cast<std::size_t>(k)] = by_mean[k];
    out.parameters.opacities[i] = sums[i].opacity;
    out.center -= by_offset;
  }
  return out;
}

Parameters ray_gradient(const Parameters& parameters,
                        const TraceOptions& options,
                        std::span<const RayQuery> rays,
                        std::span<const double> gradients,
                        ColorMode color_mode) {
  if (gradients.size() != 4 * rays.size()) {
    throw UsageError("the gradients of the rays are not 4 numbers each, pass 4 x rays numbers");
  }
  const auto prepared = prepare(parameters, options);
  Parameters out = parameters.zeros();
  std::vector<Sums> sums(parameters.size());
  for (std::size_t n = 0; n < rays.size(); ++n) {
    const RayQuery& query = rays[n];
    const RayTrace ray = trace_ray(parameters, prepared, options, query.origin, query.direction,
                                   query.t_min, query.t_max, color_mode);
    const double* g = &gradients[4 * n];
    glm::dvec3 by_origin(0.0);
    glm::dvec3 by_direction(0.0);
    backward_ray(ray, prepared, options, query.origin, query.direction,
                 glm::dvec3(g[0], g[1], g[2]), g[3], sums, by_origin, by_direction);
    // Every ray sees another colour.
    const bool from_origin = color_mode == ColorMode::kFromOrigin;
    for (const Hit& hit : ray.hits) {
      const std::size_t i = hit.index;
      const glm::dvec3 towards = from_origin ? prepared[i].mean - query.origin : query.direction;
      const glm::dvec3 by_offset =
          color_backward(parameters, i, towards, sums[i].color, options.raise_clamped, out);
      for (int k = 0; from_origin && k < 3; ++k)
        out.means[3 * i + static_cast<std::size_t>(k)] += by_offset[k];
      sums[i].color = glm::dvec3(0.0);
    }
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    whitening_backward(parameters, i, prepared[i].whitening, sums[i].whitening, out);
    const glm::dvec3 by_mean = -glm::transpose(prepared[i].whitening) * sums[i].whitened;
    for (int k = 0; k < 3; ++k) out.means[3 * i + static_cast<std::size_t>(k)] += by_mean[k];
    out.opacities[i] = sums[i].opacity;
  }
  return out;
}

}  // namespace raysplats::reference
