// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/image.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

using Rgb = std::array<float, 3>;

/// Surface of a mesh. Colours are display values, as the Gaussians' are (docs/light.md).
struct Material {
  enum class Kind {
    kDiffuse,      ///< Lambert, plus a specular lobe where `specular` > 0
    kMirror,       ///< reflects times `color`; rough where `roughness` > 0
    kGlass,        ///< dielectric of index `ior`: Fresnel reflection and refraction times `color`
    kTransparent,  ///< lit like diffuse with weight `opacity`; the ray goes straight on
    kEmissive,     ///< `emission` alone
  };
  std::string name;
  Kind kind = Kind::kDiffuse;
  Rgb color{0.8f, 0.8f, 0.8f};
  int texture = -1;             ///< multiplies `color`; index into the textures, -1 = none
  float specular = 0.0f;        ///< strength of the specular lobe of kDiffuse and kTransparent
  float roughness = 0.0f;       ///< in [0, 1]: of the mirror, or width of the specular lobe
  float ior = 1.5f;             ///< of kGlass, > 0
  Rgb absorption{0, 0, 0};      ///< of kGlass per world unit (Beer's law), >= 0
  float opacity = 1.0f;         ///< of kTransparent, in [0, 1]
  Rgb emission{0, 0, 0};        ///< added wherever the surface is seen
  std::optional<float> shadow;  ///< share of light it takes from a shadow ray; see shadow_opacity()
};

/// The share of light that a surface takes from a shadow ray, in [0, 1]: `shadow` where given, else
/// `opacity` for transparent, 0.2 for glass, 0 for emissive surfaces and 1 for others.
float shadow_opacity(const Material& material);

/// Triangles with corners shared by index. Positions are in world units.
struct Mesh {
  std::vector<float> positions;          ///< 3 V
  std::vector<float> normals;            ///< 3 V unit vectors, or empty: flat
  std::vector<float> uvs;                ///< 2 V, (0, 0) is the image's top left, or empty
  std::vector<std::uint32_t> triangles;  ///< 3 T indices of vertices
  std::vector<std::uint32_t> materials;  ///< T indices into the materials
  std::size_t vertex_count() const { return positions.size() / 3; }
  std::size_t triangle_count() const { return triangles.size() / 3; }
};

/// Light source. Colours times intensity: a diffuse surface of colour c that faces a point light of
/// colour 1 at distance 1, or a directional light of colour 1, shows c.
struct Light {
  enum class Kind {
    kPoint,
    kDirectional,
    kSphere,  ///< soft shadows; with radius 0 a point
  };
  Kind kind = Kind::kPoint;
  std::array<float, 3> position{0, 0, 0};
  std::array<float, 3> direction{0, -1, 0};  ///< in which a directional light shines
  Rgb color{1, 1, 1};
  float radius = 0.0f;
};

/// What rays that leave the scene see.
struct Environment {
  Rgb color{0, 0, 0};  ///< constant, or factor of the image
  Image equirect;      ///< 3 channels, any size; empty = `sky`, or constant
  std::array<float, 3> up{0, 1, 0};
  float rotation = 0.0f;  ///< degrees about `up`
  SkyLight sky{};         ///< in world axes, turned by `rotation`; empty = constant
};

/// Which shadows are cast; `strength` 0 switches all off, 1 is full darkness where no light comes.
struct ShadowSettings {
  bool mesh_on_mesh = true;
  bool mesh_on_gaussians = true;
  bool gaussians_on_mesh = true;
  bool gaussians_on_gaussians = false;
  float strength = 0.7f;
};

struct RenderSettings {
  int samples = 1;                 ///< rays per pixel; above 1 they are spread over it
  int max_bounces = 8;             ///< surfaces that a path may meet
  float min_throughput = 0.0005f;  ///< a path that carries less ends; no pixel loses more by it
  std::uint64_t seed = 0;
  Rgb ambient{0.2f, 0.2f, 0.2f};  ///< light on diffuse surfaces besides lights and environment
  bool indirect = false;          ///< diffuse surfaces gather light by rays instead of `ambient`
  int light_samples = 4;          ///< shadow rays per sphere light, surface and sample
  float aperture = 0.0f;          ///< radius of the lens in world units; 0 = everything is sharp
  float focus_distance = 1.0f;    ///< depth of what is sharp
  float bias = 0.0f;              ///< start of shadow rays from Gaussians; 0 = 1/1000 of their size
  ShadowSettings shadows;
};

/// Everything that PathTracer draws, in world units.
struct Scene {
  Gaussians gaussians;       ///< all models together
  std::vector<Mesh> meshes;  ///< `materials` index the scene's
  std::vector<Material> materials;
  std::vector<Image> textures;  ///< 3 channels
  std::vector<Light> lights;
  Environment environment;
  RenderSettings render;
  TraceOptions trace;
};

}  // namespace raysplats
