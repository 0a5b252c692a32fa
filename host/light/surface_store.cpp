// SPDX-License-Identifier: Apache-2.0
#include "light/surface_store.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "light/environment.hpp"
#include "raysplats/error.hpp"
#include "scene/mesh/mesh.hpp"
#include "shared/light_layout.h"

namespace raysplats {
namespace {

bool all_within(std::span<const float> values, float low, float high) {
  return std::all_of(values.begin(), values.end(), [&](float v) { return v >= low && v <= high; });
}

constexpr float kHuge = std::numeric_limits<float>::max();
// Brighter light than any picture needs, and small enough that sums and products of it stay finite.
constexpr float kMaxLight = 1e6f;

void check(const Material& m, std::size_t texture_count) {
  const bool sound = all_within(m.color, 0, 1) && all_within(m.absorption, 0, kHuge) &&
                     all_within(m.emission, 0, kMaxLight) &&
                     all_within(std::array{m.opacity, m.roughness, shadow_opacity(m)}, 0, 1) &&
                     m.specular >= 0 && m.specular <= kHuge && m.ior > 0 && m.ior <= kHuge;
  if (!sound) {
    throw UsageError(fmt::format(
        "Material '{}' is out of range: colours, opacity, roughness and shadow lie in [0, 1], "
        "emission in [0, 1e6], absorption and specular must not be negative, and ior is positive",
        m.name));
  }
  if (m.texture >= 0 && static_cast<std::size_t>(m.texture) >= texture_count) {
    throw UsageError(
        fmt::format("Material '{}' names texture {} of {}", m.name, m.texture, texture_count));
  }
}

void check_light(std::span<const float> values, const char* what) {
  if (all_within(values, 0, kMaxLight)) return;
  throw UsageError(
      fmt::format("{} has a number that is not finite, negative or above 1e6: correct it", what));
}

RsMaterial record(const Material& m) {
  RsMaterial out{};
  out.kind = static_cast<std::int32_t>(m.kind);
  std::copy(m.color.begin(), m.color.end(), out.color);
  out.texture = m.texture;
  out.specular = m.specular;
  out.roughness = m.roughness;
  out.ior = m.ior;
  std::copy(m.absorption.begin(), m.absorption.end(), out.absorption);
  out.opacity = m.opacity;
  std::copy(m.emission.begin(), m.emission.end(), out.emission);
  out.shadow = shadow_opacity(m);
  return out;
}
static_assert(static_cast<int>(Material::Kind::kDiffuse) == RS_DIFFUSE &&
              static_cast<int>(Material::Kind::kMirror) == RS_MIRROR &&
              static_cast<int>(Material::Kind::kGlass) == RS_GLASS &&
              static_cast<int>(Material::Kind::kTransparent) == RS_TRANSPARENT &&
              static_cast<int>(Material::Kind::kEmissive) == RS_EMISSIVE);
static_assert(static_cast<int>(Light::Kind::kPoint) == RS_LIGHT_POINT &&
              static_cast<int>(Light::Kind::kDirectional) == RS_LIGHT_DIRECTIONAL &&
              static_cast<int>(Light::Kind::kSphere) == RS_LIGHT_SPHERE);

RsLight record(const Light& light, std::size_t number) {
  const std::array<float, 3>& d = light.direction;
  const float length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  const bool sound = all_within(light.color, 0, kHuge) &&
                     all_within(light.position, -kHuge, kHuge) && light.radius >= 0 &&
                     light.radius <= kHuge && length <= kHuge &&
                     (light.kind != Light::Kind::kDirectional || length > 0);
  if (!sound) {
    throw UsageError(fmt::format(
        "Light {} is out of range: colour and radius must not be negative, and the direction of a "
        "directional light must not be zero",
        number));
  }
  RsLight out{};
  out.kind = static_cast<std::int32_t>(light.kind);
  std::copy(light.position.begin(), light.position.end(), out.position);
  for (std::size_t k = 0; k < 3; ++k) out.direction[k] = length > 0 ? d[k] / length : 0.0f;
  std::copy(light.color.begin(), light.color.end(), out.color);
  out.radius = light.radius;
  return out;
}

template <class T>
void store(Context& context, const std::vector<T>& values, const char* label, Buffer<T>& buffer) {
  buffer.ensure(context, values.size(), label);
  buffer.upload(values);
}

}  // namespace

SurfaceStore::SurfaceStore(Context& context, const Scene& scene)
    : context_(&context),
      kinds_(scene.materials),
      triangles_(context, scene.trace.launch_budget_ms) {
  std::vector<RsTexture> textures;
  std::vector<float> texels;
  for (const Image& image : scene.textures) {
    if (image.channels != 3 || image.pixels() == 0 || image.data.size() != 3 * image.pixels()) {
      throw UsageError(
          "A texture must have three channels and at least one texel, all of them in its data");
    }
    check_light(image.data, "A texture");
    textures.push_back(
        {static_cast<std::uint32_t>(texels.size() / 3), image.width, image.height, 0});
    texels.insert(texels.end(), image.data.begin(), image.data.end());
  }
  if (texels.size() / 3 > std::numeric_limits<std::uint32_t>::max()) {
    throw ResourceError("The textures have more than 2^32 texels together: reduce them");
  }
  std::vector<RsMaterial> materials;
  for (const Material& material : scene.materials) {
    check(material, scene.textures.size());
    materials.push_back(record(material));
  }
  check_light(scene.environment.color, "The environment's colour");
  check_light(scene.environment.equirect.data, "The environment's picture");
  check_light(scene.render.ambient, "The ambient light");
  std::vector<RsLight> lights;
  for (const Light& light : scene.lights) lights.push_back(record(light, lights.size()));
  store(context, textures, "textures", textures_);
  store(context, texels, "texels", texels_);
  store(context, materials, "materials", materials_);
  store(context, lights, "lights", lights_);
  const Environment environment = with_drawn_sky(scene.environment);
  store(context, std::vector{environment_record(environment)}, "environment", environment_);
  store(context, environment.equirect.data, "environment picture", environment_picture_);
  set_meshes(scene.meshes);
}

void SurfaceStore::set_meshes(const std::vector<Mesh>& meshes) {
  for (std::size_t m = 0; m < meshes.size(); ++m)
    validate(meshes[m], kinds_.size(), fmt::format("{}", m));
  triangles_.build(meshes);
  std::vector<float> vertices;
  std::vector<std::uint32_t> of;
  std::vector<float> shadows;
  vertices.reserve(RS_TRIANGLE_FLOATS * triangles_.size());
  lit_ = false;
  for (const Mesh& mesh : meshes) {
    for (std::size_t i = 0; i < 3 * mesh.triangle_count(); ++i) {
      const std::size_t v = mesh.triangles[i];
      for (std::size_t k = 0; k < 3; ++k) vertices.push_back(mesh.positions[3 * v + k]);
      for (std::size_t k = 0; k < 3; ++k) {
        vertices.push_back(mesh.normals.empty() ? 0.0f : mesh.normals[3 * v + k]);
      }
      for (std::size_t k = 0; k < 2; ++k) {
        vertices.push_back(mesh.uvs.empty() ? 0.0f : mesh.uvs[2 * v + k]);
      }
    }
    for (const std::uint32_t material : mesh.materials) {
      const Material& kind = kinds_[material];
      lit_ = lit_ || kind.kind == Material::Kind::kDiffuse ||
             kind.kind == Material::Kind::kTransparent;
      of.push_back(material);
      shadows.push_back(shadow_opacity(kind));
    }
  }
  store(*context_, vertices, "mesh vertices", vertices_);
  store(*context_, of, "triangle materials", triangle_materials_);
  store(*context_, shadows, "triangle shadows", triangle_shadows_);
}

}  // namespace raysplats
