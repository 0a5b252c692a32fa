// SPDX-License-Identifier: Apache-2.0
#include "reference/light.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "raysplats/error.hpp"
#include "reference/light_shading.hpp"
#include "reference/optics.hpp"
#include "scene/mesh/shadow_bias.hpp"

namespace raysplats::reference {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNegligible = 1e-4;
constexpr double kFaint = 1e-3;  ///< Gaussians up to this alpha have no shadow
constexpr std::size_t kNestedBodies = 4;
constexpr int kSplits = 2;

glm::dvec3 vector(const std::array<float, 3>& v) { return {v[0], v[1], v[2]}; }
double largest(const glm::dvec3& v) { return std::max({v.x, v.y, v.z}); }

/// exp(-sigma l), and 1 where sigma is 0 even for an infinite l.
glm::dvec3 absorbed(const glm::dvec3& sigma, double length) {
  glm::dvec3 out(1.0);
  for (int c = 0; c < 3; ++c) {
    if (sigma[c] > 0.0) out[c] = std::exp(-sigma[c] * length);
  }
  return out;
}

struct State {
  glm::dvec3 origin{0.0};
  glm::dvec3 direction{0.0};
  double t_start = 0.0;
  int skip = -1;        ///< triangle that the ray starts at
  bool direct = false;  ///< straight from a camera's centre
  Cone cone;
  glm::dvec3 throughput{1.0};
  double probability = 1.0;
  int surfaces = 0;
  int splits = 0;
  std::vector<std::size_t> bodies;
};

class Walk {
 public:
  Walk(const LightScene& scene, LightPath& path) : scene_(scene), path_(path) {}

  void go(State state);

 private:
  void go_on(State state, const glm::dvec3& factor);
  void glass(const State& state, const Material& material, const SurfacePoint& point, double t);
  RayTrace gaussians(const State& state, double t_end, double& margin);
  void note(const State& state, double margin) {
    if (state.probability * largest(state.throughput) > kNegligible) {
      path_.margin = std::min(path_.margin, margin);
    }
  }
  double index_of(std::size_t material) const { return scene_.scene.materials[material].ior; }

  const LightScene& scene_;
  LightPath& path_;
};

/// The Gaussian of the median depth, or else of the largest weight.
std::size_t leading(const RayTrace& ray, double& margin) {
  std::size_t index = ray.hits.front().index;
  double most = 0.0, second = 0.0;
  for (const Hit& hit : ray.hits) {
    if (hit.transmittance < 0.5) break;
    const double weight = hit.transmittance * hit.alpha;
    if (hit.transmittance * (1.0 - hit.alpha) < 0.5) return hit.index;
    if (weight > most) {
      second = most;
      most = weight;
      index = hit.index;
    } else {
      second = std::max(second, weight);
    }
  }
  margin = std::min(margin, most - second);
  return index;
}

/// Adds T s C to the result; returns what the ray met.
RayTrace Walk::gaussians(const State& state, double t_end, double& margin) {
  const double t_min = state.t_start > 0.0 ? std::nextafter(state.t_start, kInfinity) : 0.0;
  RayTrace ray = trace_ray(
      scene_.parameters, scene_.prepared, scene_.options, state.origin, state.direction, t_min,
      t_end, state.direct ? ColorMode::kFromOrigin : ColorMode::kAlongRay, state.cone);
  margin = std::min(margin, ray.margin);
  if (ray.hits.empty()) return ray;
  const double depth = std::min(ray.alpha > 0.5 ? ray.median_depth : ray.expected_depth, t_end);
  glm::dvec3 light = ray.color;
  const glm::dvec3 sigma = state.bodies.empty()
                               ? glm::dvec3(0.0)
                               : vector(scene_.scene.materials[state.bodies.back()].absorption);
  const bool lit = !scene_.scene.lights.empty();
  const bool shaded = lit && ray.alpha > kFaint;
  if (lit) margin = std::min(margin, std::abs(ray.alpha - kFaint));
  if (shaded || largest(sigma) > 0.0) {
    // The median moves from Gaussian to Gaussian.
    for (const Hit& hit : ray.hits) {
      margin = std::min(margin, std::abs(hit.transmittance * (1.0 - hit.alpha) - 0.5));
    }
  }
  light *= absorbed(sigma, depth - state.t_start);
  if (shaded) {
    light *= gaussian_shadow(scene_, state.origin + depth * state.direction, leading(ray, margin),
                             margin);
  }
  path_.color += state.probability * state.throughput * light;
  return ray;
}

void Walk::go(State state) {
  double margin = 1.0;
  const TriangleHit hit = nearest_triangle(scene_.triangles, state.origin, state.direction,
                                           state.t_start, state.skip, margin);
  path_.segments.push_back({state.origin, state.direction, state.t_start, hit.t,
                            state.probability * state.throughput, state.surfaces, hit.triangle,
                            state.bodies});
  const RayTrace ray = gaussians(state, hit.t, margin);
  note(state, margin);
  if (!state.bodies.empty()) {
    state.throughput *= absorbed(vector(scene_.scene.materials[state.bodies.back()].absorption),
                                 hit.t - state.t_start);
  }
  state.throughput *= ray.transmittance;
  const glm::dvec3 weight = state.probability * state.throughput;
  if (hit.triangle < 0) {
    path_.color += weight * scene_.environment.seen(state.direction);
    path_.alpha -= (weight.r + weight.g + weight.b) / 3.0;
    return;
  }

  margin = 1.0;
  const SurfacePoint point = surface_point(scene_, hit, state.origin, state.direction, margin);
  const std::size_t index = scene_.triangles[static_cast<std::size_t>(hit.triangle)].material;
  const Material& material = scene_.scene.materials[index];
  path_.color += weight * vector(material.emission);
  ++state.surfaces;
  state.skip = hit.triangle;
  switch (material.kind) {
    case Material::Kind::kDiffuse:
      path_.color += weight * diffuse_light(scene_, material, point, state.direction, margin);
      break;
    case Material::Kind::kEmissive:
      break;
    case Material::Kind::kTransparent: {
      const double opacity = material.opacity;
      if (opacity > 0.0) {
        path_.color +=
            opacity * weight * diffuse_light(scene_, material, point, state.direction, margin);
      }
      State behind = state;
      behind.t_start = hit.t;
      go_on(behind, glm::dvec3(1.0 - opacity));
      break;
    }
    case Material::Kind::kMirror: {
      State next = state;
      next.origin = point.position;
      next.t_start = 0.0;
      next.direct = false;
      next.cone.width += next.cone.spread * hit.t;
      next.direction = reflected(state.direction, point.shading_normal);
      const double above = glm::dot(next.direction, point.geometric_normal);
      margin = std::min(margin, std::abs(above));
      if (above <= 0.0) next.direction = reflected(state.direction, point.geometric_normal);
      go_on(next, point.color);
      break;
    }
    case Material::Kind::kGlass:
      glass(state, material, point, hit.t);
      break;
  }
  note(state, margin);
}

void Walk::go_on(State state, const glm::dvec3& factor) {
  if (state.surfaces >= scene_.scene.render.max_bounces) return;
  const double limit = scene_.scene.render.min_throughput;
  const double before = largest(state.throughput);
  state.throughput *= factor;
  const double after = largest(state.throughput);
  if (limit > 0.0 && state.probability * before > kNegligible) {
    path_.margin = std::min(path_.margin, std::abs(after - limit) / limit);
  }
  if (after < limit) return;
  go(std::move(state));
}

void Walk::glass(const State& state,
                 const Material& material,
                 const SurfacePoint& point,
                 double t) {
  const std::size_t index = scene_.triangles[static_cast<std::size_t>(point.triangle)].material;
  // Indices before and after, and the bodies after.
  std::vector<std::size_t> bodies = state.bodies;
  double before = bodies.empty() ? 1.0 : index_of(bodies.back());
  double after = material.ior;
  if (point.from_outside) {
    if (bodies.size() < kNestedBodies) bodies.push_back(index);
  } else {
    const auto entry = std::find(bodies.rbegin(), bodies.rend(), index);
    if (entry == bodies.rend()) {
      before = material.ior;
    } else {
      bodies.erase(std::next(entry).base());
    }
    after = bodies.empty() ? 1.0 : index_of(bodies.back());
  }

  if (before == after) {
    State behind = state;
    behind.t_start = t;
    behind.bodies = bodies;
    go_on(behind, point.color);
    return;
  }

  // About n where that keeps both rays on their sides, else about N.
  double margin = 1.0;
  const glm::dvec3& d = state.direction;
  glm::dvec3 n = point.shading_normal;
  std::optional<glm::dvec3> through;
  const double facing = glm::dot(d, n);
  bool sound = facing < 0.0;
  margin = std::min(margin, std::abs(facing));
  if (sound) {
    through = refracted(d, n, before, after);
    const double up = glm::dot(reflected(d, n), point.geometric_normal);
    const double down = through ? glm::dot(*through, point.geometric_normal) : -1.0;
    margin = std::min({margin, std::abs(up), std::abs(down)});
    sound = up > 0.0 && down < 0.0;
  }
  if (!sound) {
    n = point.geometric_normal;
    through = refracted(d, n, before, after);
  }
  const double cosine = -glm::dot(d, n);
  const double ratio = before / after;
  margin = std::min(margin, std::abs(1.0 - ratio * ratio * (1.0 - cosine * cosine)));
  const double share = through ? fresnel(cosine, before, after) : 1.0;

  State next = state;
  next.origin = point.position;
  next.t_start = 0.0;
  next.direct = false;
  next.cone.width += next.cone.spread * t;
  note(state, margin);
  State reflection = next;
  reflection.direction = reflected(d, n);
  if (!through) {
    go_on(reflection, glm::dvec3(1.0));
    return;
  }
  State refraction = next;
  refraction.direction = *through;
  refraction.bodies = bodies;
  if (state.splits < kSplits) {
    ++reflection.splits;
    ++refraction.splits;
    go_on(reflection, glm::dvec3(share));
    go_on(refraction, (1.0 - share) * point.color);
    return;
  }
  if (state.surfaces < scene_.scene.render.max_bounces) {
    path_.chance += state.probability * largest(state.throughput);
  }
  reflection.probability *= share;
  refraction.probability *= 1.0 - share;
  go_on(reflection, glm::dvec3(1.0));
  go_on(refraction, point.color);
}

}  // namespace

LightScene::LightScene(const Scene& source)
    : scene(source),
      parameters(source.gaussians),
      triangles(triangles_of(source.meshes)),
      environment(source.environment),
      options(source.trace),
      bias(shadow_bias(source)) {
  if (source.render.indirect) {
    throw UsageError("the reference of light has no indirect light, switch it off");
  }
  options.background = {0.0f, 0.0f, 0.0f};
  prepared = prepare(parameters, options);
}

LightPath trace_light(const LightScene& scene,
                      const glm::dvec3& origin,
                      const glm::dvec3& direction,
                      bool from_center,
                      const Cone& cone) {
  LightPath path;
  path.alpha = 1.0;
  State state;
  state.origin = origin;
  state.direction = glm::normalize(direction);
  state.direct = from_center;
  state.cone = cone;
  Walk(scene, path).go(state);
  return path;
}

LightPath trace_light(const Scene& scene, const glm::dvec3& origin, const glm::dvec3& direction) {
  return trace_light(LightScene(scene), origin, direction);
}

LightRender render_light(const Scene& source, const Camera& camera) {
  if (camera.model != CameraModel::kPinhole) {
    throw UsageError("the reference of light knows pinhole cameras alone");
  }
  const LightScene scene(source);
  const glm::dmat3 to_world = glm::transpose(camera.rotation);
  LightRender out;
  out.width = camera.width;
  out.height = camera.height;
  const std::size_t pixels = out.pixels();
  out.image.resize(4 * pixels);
  for (int row = 0; row < camera.height; ++row) {
    for (int column = 0; column < camera.width; ++column) {
      const std::size_t pixel = out.margin.size();
      const glm::dvec3 direction = to_world * pixel_direction(camera, column, row);
      const Cone cone = pixel_cone(camera, scene.options, glm::normalize(direction));
      const LightPath path = trace_light(scene, camera.center(), direction, true, cone);
      for (int c = 0; c < 3; ++c) {
        out.image[static_cast<std::size_t>(c) * pixels + pixel] = path.color[c];
      }
      out.image[3 * pixels + pixel] = path.alpha;
      out.margin.push_back(path.margin);
      out.chance.push_back(path.chance);
    }
  }
  return out;
}

}  // namespace raysplats::reference
