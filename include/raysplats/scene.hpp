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

/// Red, green and blue; 1 is display white.
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
  std::string name;             ///< for messages
  Kind kind = Kind::kDiffuse;   ///< decides which of the others count
  Rgb color{0.8f, 0.8f, 0.8f};  ///< display values of the surface, in [0, 1]
  int texture = -1;             ///< multiplies `color`; index into the textures, -1 = none
  float specular = 0.0f;        ///< weight of the specular lobe of kDiffuse and kTransparent, >= 0
  float roughness = 0.0f;       ///< in [0, 1]: of the mirror, or width of the specular lobe
  float ior = 1.5f;             ///< index of refraction of kGlass, > 0
  Rgb absorption{0, 0, 0};      ///< of kGlass per world unit (Beer's law), >= 0
  float opacity = 1.0f;         ///< of kTransparent, in [0, 1]
  Rgb emission{0, 0, 0};        ///< display values, in [0, 1e6], added wherever it is seen
  std::optional<float> shadow;  ///< share of light it takes, in [0, 1]; see shadow_opacity()
};

/// The share of light that a surface takes from a shadow ray, in [0, 1]: `shadow` where given, else
/// `opacity` for transparent, 0.2 for glass, 0 for emissive surfaces and 1 for others.
float shadow_opacity(const Material& material);

/// Triangles with corners shared by index. Positions are in world units.
struct Mesh {
  std::vector<float> positions;          ///< V x 3
  std::vector<float> normals;            ///< V x 3: unit vectors; empty = flat
  std::vector<float> uvs;                ///< V x 2: (0, 0) is the image's top left; may be empty
  std::vector<std::uint32_t> triangles;  ///< T x 3: indices of vertices
  std::vector<std::uint32_t> materials;  ///< T: indices into the materials
  std::size_t vertex_count() const { return positions.size() / 3; }
  std::size_t triangle_count() const { return triangles.size() / 3; }
};

/// Light source. Colours times intensity: a diffuse surface of colour c that faces a point light of
/// colour 1 at distance 1, or a directional light of colour 1, shows c.
struct Light {
  enum class Kind {
    kPoint,        ///< falls with the square of the distance
    kDirectional,  ///< from far away, the same everywhere
    kSphere,       ///< soft shadows; with radius 0 a point
  };
  Kind kind = Kind::kPoint;                  ///< decides which of the others count
  std::array<float, 3> position{0, 0, 0};    ///< of kPoint and kSphere, world units
  std::array<float, 3> direction{0, -1, 0};  ///< of kDirectional: where it shines, any length
  Rgb color{1, 1, 1};                        ///< display values times intensity, >= 0
  float radius = 0.0f;                       ///< of kSphere, world units
};

/// What rays that leave the scene see.
struct Environment {
  Rgb color{0, 0, 0};  ///< display values, in [0, 1e6]: constant, or factor of the image
  Image equirect;      ///< 3 channels, as `color`, any size; empty = `sky`, or constant
  std::array<float, 3> up{0, 1, 0};  ///< where the top of the image is, in world axes
  float rotation = 0.0f;             ///< degrees about `up`, right-handed
  SkyLight sky{};                    ///< in world axes, turned by `rotation`; empty = constant
};

/// Which shadows are cast, and how dark.
struct ShadowSettings {
  bool mesh_on_mesh = true;             ///< shadows of meshes on meshes
  bool mesh_on_gaussians = true;        ///< shadows of meshes on Gaussians
  bool gaussians_on_mesh = true;        ///< shadows of Gaussians on meshes
  bool gaussians_on_gaussians = false;  ///< shadows of Gaussians on Gaussians
  /// In [0, 1]: 0 switches all off, 1 is full darkness where no light comes.
  float strength = 0.7f;
};

/// How a picture of a scene is made.
struct RenderSettings {
  int samples = 1;      ///< rays per pixel, >= 1; above 1 they are spread over it
  int max_bounces = 8;  ///< surfaces that a path may meet, >= 1
  /// In [0, 1]: a path that carries a smaller share of light ends; no pixel loses more by it.
  float min_throughput = 0.0005f;
  std::uint64_t seed = 0;  ///< of everything that is random
  /// Display values, in [0, 1e6]: light besides lights and environment.
  Rgb ambient{0.2f, 0.2f, 0.2f};
  bool indirect = false;        ///< diffuse surfaces gather light by rays instead of `ambient`
  int light_samples = 4;        ///< shadow rays per sphere light, surface and sample
  float aperture = 0.0f;        ///< radius of the lens, world units; 0 = everything is sharp
  float focus_distance = 1.0f;  ///< depth of what is sharp, world units
  /// World units from a Gaussian to where its shadow rays start; 0 = 1/1000 of the size of all
  /// Gaussians.
  float bias = 0.0f;
  ShadowSettings shadows;  ///< of meshes and Gaussians
};

/// Everything that PathTracer draws, in world units.
struct Scene {
  Gaussians gaussians;              ///< all models together
  std::vector<Mesh> meshes;         ///< `materials` index the scene's
  std::vector<Material> materials;  ///< `texture` indexes the scene's
  std::vector<Image> textures;      ///< 3 channels, display values, in [0, 1e6]
  std::vector<Light> lights;        ///< beside `environment` and RenderSettings::ambient
  Environment environment;          ///< behind everything
  RenderSettings render;            ///< how the picture is made
  TraceOptions trace;               ///< how rays meet Gaussians
};

}  // namespace raysplats
