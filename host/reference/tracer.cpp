// SPDX-License-Identifier: Apache-2.0
#include "reference/tracer.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>

#include "reference/sky.hpp"
#include "scene/camera/pixel_spacing.hpp"
#include "shared/layout.h"

namespace raysplats::reference {
namespace {

void lower(double& margin, double distance, double scale) {
  margin = std::min(margin, std::abs(distance) / std::max(std::abs(scale), 1e-300));
}

/// Tests one Gaussian; true when the ray meets it. Paper prop. 3.1 and appendix A.1, A.2.
bool intersect(const PreparedGaussian& g,
               const TraceOptions& options,
               const glm::dvec3& origin,
               const glm::dvec3& direction,
               double t_min,
               double t_max,
               Hit& hit,
               double& margin) {
  if (!g.visible || g.quantile < 0.0) return false;
  const glm::dvec3 o = g.whitening * (origin - g.mean);
  const glm::dvec3 d = g.whitening * direction;
  const double dd = glm::dot(d, d);
  const double od = glm::dot(o, d);
  if (!(dd > 0.0)) return false;
  hit.slope = od / dd;
  hit.residual = o - hit.slope * d;
  hit.t_peak = -hit.slope;
  const double delta2 = glm::dot(hit.residual, hit.residual);

  hit.t = hit.t_peak;
  if (options.hit_order == HitOrder::kEntry && delta2 <= g.quantile) {
    const double root = std::sqrt(dd * (g.quantile - delta2));
    const double far_from_zero = (-od - (od >= 0.0 ? root : -root)) / dd;
    hit.t = od >= 0.0 ? far_from_zero : (glm::dot(o, o) - g.quantile) / (dd * far_from_zero);
  }
  const bool in_range = hit.t >= std::max(t_min, 0.0) && hit.t <= t_max;
  if (in_range) lower(margin, delta2 - g.quantile, g.quantile);
  if (delta2 > g.quantile) return false;
  const double size = 1.0 / std::sqrt(dd);
  lower(margin, hit.t - std::max(t_min, 0.0), size);
  lower(margin, hit.t - t_max, size);
  hit.alpha = g.opacity * std::exp(-0.5 * delta2);
  return in_range;
}

glm::dvec3 color_direction(ColorMode mode,
                           const glm::dvec3& mean,
                           const glm::dvec3& origin,
                           const glm::dvec3& direction) {
  const glm::dvec3 v = mode == ColorMode::kFromOrigin ? mean - origin : direction;
  const double length = glm::length(v);
  return length > 0.0 ? v / length : glm::normalize(direction);
}

/// Raises the axes of Gaussian i to `least` and makes it as much fainter as its outline, seen from
/// where it is `offset` away, grows: the area is that of the covariance across the direction.
void raise_axes(const Parameters& parameters,
                const TraceOptions& options,
                std::size_t i,
                double least,
                const glm::dvec3& offset,
                PreparedGaussian& g) {
  const glm::dmat3 rotation =
      rotation_matrix({parameters.quaternions[4 * i], parameters.quaternions[4 * i + 1],
                       parameters.quaternions[4 * i + 2], parameters.quaternions[4 * i + 3]});
  const glm::dvec3 direction = glm::normalize(offset);
  const glm::dvec3 right = glm::normalize(glm::cross(
      direction, std::abs(direction.x) < 0.5 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)));
  const glm::dvec3 up = glm::cross(direction, right);
  const auto area = [&](const glm::dvec3& scale) {
    double across[3] = {0, 0, 0};  // the covariance: right-right, right-up, up-up
    for (int k = 0; k < 3; ++k) {
      const double x = scale[k] * glm::dot(rotation[k], right);
      const double y = scale[k] * glm::dot(rotation[k], up);
      across[0] += x * x;
      across[1] += x * y;
      across[2] += y * y;
    }
    return std::sqrt(across[0] * across[2] - across[1] * across[1]);
  };
  glm::dvec3 own, raised;
  for (int k = 0; k < 3; ++k) {
    own[k] = activated_scale(parameters.scales[3 * i + static_cast<std::size_t>(k)],
                             parameters.activation);
    raised[k] = std::max(own[k], least);
  }
  glm::dmat3 columns = rotation;
  for (int k = 0; k < 3; ++k) columns[k] /= raised[k];
  g.whitening = glm::transpose(columns);
  g.opacity *= std::pow(area(own) / area(raised), RS_FOOTPRINT_POWER);
  g.quantile = effective_quantile(options, g.opacity);
}

}  // namespace

std::vector<PreparedGaussian> prepare(const Parameters& parameters, const TraceOptions& options) {
  std::vector<PreparedGaussian> out(parameters.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].mean = parameters.mean(i);
    out[i].whitening = whitening_matrix(parameters, i);
    out[i].opacity = sigmoid(parameters.opacities[i]);
    out[i].quantile = effective_quantile(options, out[i].opacity);
  }
  return out;
}

RayTrace trace_ray(const Parameters& parameters,
                   const TraceOptions& options,
                   const glm::dvec3& origin,
                   const glm::dvec3& direction,
                   double t_min,
                   double t_max,
                   ColorMode color_mode) {
  return trace_ray(parameters, prepare(parameters, options), options, origin, direction, t_min,
                   t_max, color_mode);
}

RayTrace trace_ray(const Parameters& parameters,
                   const std::vector<PreparedGaussian>& prepared,
                   const TraceOptions& options,
                   const glm::dvec3& origin,
                   const glm::dvec3& direction,
                   double t_min,
                   double t_max,
                   ColorMode color_mode,
                   const Cone& cone) {
  RayTrace out;
  std::vector<Hit> all;
  for (std::size_t i = 0; i < prepared.size(); ++i) {
    PreparedGaussian seen = prepared[i];
    const glm::dvec3 offset = seen.mean - origin;
    const double least = cone.width + cone.spread * glm::dot(direction, offset);
    if (least > 0.0) {
      raise_axes(parameters, options, i, least, cone.spread * offset + cone.width * direction,
                 seen);
    }
    Hit hit;
    hit.index = static_cast<std::uint32_t>(i);
    if (intersect(seen, options, origin, direction, t_min, t_max, hit, out.margin))
      all.push_back(hit);
  }
  std::sort(all.begin(), all.end(),
            [](const Hit& a, const Hit& b) { return a.t != b.t ? a.t < b.t : a.index < b.index; });

  const double stop = options.min_transmittance;
  const auto max_hits = static_cast<std::size_t>(std::max(options.max_hits, 0));
  double depth_sum = 0.0;
  double weight_sum = 0.0;
  double& transmittance = out.transmittance;
  for (std::size_t n = 0; n < all.size(); ++n) {
    if (n > 0) lower(out.margin, all[n].t - all[n - 1].t, all[n].t);
    if (transmittance < stop) break;
    if (n == max_hits) {
      out.capped = true;
      break;
    }
    Hit& hit = all[n];
    const std::size_t i = hit.index;
    hit.transmittance = transmittance;
    hit.color =
        color(parameters, i, color_direction(color_mode, prepared[i].mean, origin, direction));
    const double weight = transmittance * hit.alpha;
    out.color += weight * hit.color;
    depth_sum += weight * hit.t_peak;
    weight_sum += weight;
    transmittance *= 1.0 - hit.alpha;
    if (hit.transmittance >= 0.5 && transmittance < 0.5) out.median_depth = hit.t_peak;
    lower(out.margin, transmittance - stop, stop);
    out.hits.push_back(hit);
  }
  out.color += transmittance * light_behind(options, direction);
  out.alpha = 1.0 - transmittance;
  if (weight_sum > 0.0) out.expected_depth = depth_sum / weight_sum;
  return out;
}

namespace {

/// The footprint of a camera's pixels at a place in its axes.
double footprint_at(const Camera& camera, const TraceOptions& options, const glm::dvec3& place) {
  const double pixel = static_cast<double>(options.view_footprint) * pixel_spacing(camera);
  switch (camera.model) {
    case CameraModel::kOrthographic:
      return pixel;
    case CameraModel::kFisheye:
    case CameraModel::kEquirectangular:
      return pixel * glm::length(place);
    default:
      return pixel * place.z;
  }
}

}  // namespace

Cone pixel_cone(const Camera& camera, const TraceOptions& options, const glm::dvec3& direction) {
  const double width = footprint_at(camera, options, camera.rotation * direction);
  return camera.model == CameraModel::kOrthographic ? Cone{width, 0.0} : Cone{0.0, width};
}

glm::dvec3 pixel_direction(const Camera& camera, int column, int row) {
  return {(column + 0.5 - camera.cx) / camera.fx, (row + 0.5 - camera.cy) / camera.fy, 1.0};
}

std::vector<PreparedGaussian> prepare_view(const Parameters& parameters,
                                           const TraceOptions& options,
                                           const Camera& camera) {
  auto out = prepare(parameters, options);
  if (options.near_depth > 0.0f) {
    for (PreparedGaussian& g : out) {
      g.visible = (camera.rotation * g.mean + camera.translation).z >= options.near_depth;
    }
  }
  if (options.view_footprint > 0.0f && camera.model != CameraModel::kOrthographic) {
    for (std::size_t i = 0; i < out.size(); ++i) {
      const double least =
          footprint_at(camera, options, camera.rotation * out[i].mean + camera.translation);
      if (least > 0.0)
        raise_axes(parameters, options, i, least, out[i].mean - camera.center(), out[i]);
    }
  }
  return out;
}

Render render(const Parameters& parameters, const TraceOptions& options, const Camera& camera) {
  const auto prepared = prepare_view(parameters, options, camera);
  const glm::dmat3 to_world = glm::transpose(camera.rotation);
  const glm::dvec3 center = camera.center();
  Render out;
  out.width = camera.width;
  out.height = camera.height;
  const std::size_t pixels = out.pixels();
  out.image.resize(4 * pixels);
  out.depth.resize(3 * pixels);
  out.margin.resize(pixels);
  out.signature = 0xcbf29ce484222325ull;  // FNV-1a
  const auto hash = [&](std::uint64_t value) {
    out.signature = (out.signature ^ value) * 0x100000001b3ull;
  };
  std::size_t pixel = 0;
  for (int row = 0; row < camera.height; ++row) {
    for (int column = 0; column < camera.width; ++column, ++pixel) {
      const glm::dvec3 direction = to_world * pixel_direction(camera, column, row);
      const RayTrace ray =
          trace_ray(parameters, prepared, options, center, direction, 0.0,
                    std::numeric_limits<double>::infinity(), ColorMode::kFromOrigin);
      for (int channel = 0; channel < 3; ++channel) {
        out.image[static_cast<std::size_t>(channel) * pixels + pixel] = ray.color[channel];
      }
      out.image[3 * pixels + pixel] = ray.alpha;
      out.depth[pixel] = ray.expected_depth;
      out.depth[pixels + pixel] = ray.median_depth;
      out.depth[2 * pixels + pixel] = static_cast<double>(ray.hits.size());
      out.margin[pixel] = ray.margin;
      out.capped_rays += ray.capped ? 1 : 0;
      out.hits += ray.hits.size();
      for (const Hit& hit : ray.hits) hash(hit.index + 1u);
      hash(0);
    }
  }
  return out;
}

}  // namespace raysplats::reference
