// SPDX-License-Identifier: Apache-2.0
#include "raysplats/scene.hpp"

#include <fmt/format.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "images.hpp"
#include "io/mesh/mesh_file.hpp"
#include "io/scene/scene_file.hpp"
#include "io/scene/scene_loader.hpp"
#include "keywords.hpp"
#include "names.hpp"
#include "raysplats/error.hpp"
#include "raysplats/mirrors.hpp"
#include "run/model_source.hpp"
#include "tuples.hpp"

namespace raysplats::python {
namespace {

/// An array of the mesh, or an empty one.
std::vector<float> rows_of(const std::optional<FloatArray>& array,
                           const char* name,
                           std::ptrdiff_t width) {
  return array ? numbers(*array, name, {kAny, width}).copy() : std::vector<float>{};
}

Mesh make_mesh(const FloatArray& positions,
               const IndexArray& triangles,
               const std::optional<IndexArray>& materials,
               const std::optional<FloatArray>& normals,
               const std::optional<FloatArray>& uvs) {
  Mesh mesh;
  mesh.positions = numbers(positions, "positions", {kAny, 3}).copy();
  mesh.triangles = numbers(triangles, "triangles", {kAny, 3}).copy();
  mesh.normals = rows_of(normals, "normals", 3);
  mesh.uvs = rows_of(uvs, "uvs", 2);
  const auto count = static_cast<std::ptrdiff_t>(mesh.triangle_count());
  mesh.materials = materials ? numbers(*materials, "materials", {count}).copy()
                             : std::vector<std::uint32_t>(mesh.triangle_count(), 0);
  return mesh;
}

using MeshArrays = std::tuple<FloatArray,
                              IndexArray,
                              std::optional<IndexArray>,
                              std::optional<FloatArray>,
                              std::optional<FloatArray>>;

void bind_mesh(nb::module_& module) {
  using Self = nb::handle_t<Mesh>;
  const auto held = [](nb::handle self) -> Mesh& { return nb::cast<Mesh&>(self); };
  nb::class_<Mesh>(module, "Mesh",
                   "Triangles in world units with corners shared by index. The arrays are views.")
      .def(
          "__init__",
          [](Mesh* self, const FloatArray& positions, const IndexArray& triangles,
             const std::optional<IndexArray>& materials, const std::optional<FloatArray>& normals,
             const std::optional<FloatArray>& uvs) {
            new (self) Mesh(make_mesh(positions, triangles, materials, normals, uvs));
          },
          nb::arg("positions"), nb::arg("triangles"), nb::arg("materials") = nb::none(),
          nb::arg("normals") = nb::none(), nb::arg("uvs") = nb::none(),
          "Copies positions (V, 3), triangles (T, 3) of indices, materials (T,), indices of the "
          "scene's, else all 0, normals (V, 3), else flat, and uvs (V, 2).")
      .def_prop_rw(
          "positions",
          [held](Self self) {
            return view(self, held(self).positions.data(), {held(self).vertex_count(), 3});
          },
          set_view("positions"), "(V, 3).")
      .def_prop_rw(
          "triangles",
          [held](Self self) {
            return view(self, held(self).triangles.data(), {held(self).triangle_count(), 3});
          },
          set_view("triangles"), "(T, 3).")
      .def_prop_rw(
          "materials",
          [held](Self self) {
            return view(self, held(self).materials.data(), {held(self).materials.size()});
          },
          set_view("materials"), "(T,), indices of the scene's materials.")
      .def("__getstate__",
           [held](Self self) {
             Mesh& mesh = held(self);
             return std::tuple(nb::object(self.attr("positions")),
                               nb::object(self.attr("triangles")),
                               nb::object(self.attr("materials")),
                               view(self, mesh.normals.data(), {mesh.normals.size() / 3, 3}),
                               view(self, mesh.uvs.data(), {mesh.uvs.size() / 2, 2}));
           })
      .def(
          "__setstate__",
          [](Mesh& self, const MeshArrays& state) {
            new (&self) Mesh(std::apply(&make_mesh, state));
          },
          nb::arg("state"));
}

void bind_material(nb::module_& module) {
  nb::class_<Material> type(module, "Material",
                            "Surface of a mesh (docs/light.md); colours are display values.");
  def_keywords(type, "Material");
  type.def_rw("name", &Material::name)
      .def_prop_rw(
          "kind", [](const Material& m) { return name_of(kMaterialKinds, m.kind); },
          [](Material& m, const std::string& name) {
            m.kind = value_of(kMaterialKinds, "kind", name);
          },
          "'diffuse', 'mirror', 'glass', 'transparent' or 'emissive'.")
      .def_rw("color", &Material::color,
              "0.8 unless it is given, of mirrors and glass too: clear ones have (1, 1, 1), as "
              "scene files give them.")
      .def_rw("texture", &Material::texture, "Index of the scene's textures; -1 = none.")
      .def_rw("specular", &Material::specular)
      .def_rw("roughness", &Material::roughness)
      .def_rw("ior", &Material::ior)
      .def_rw("absorption", &Material::absorption, "Of glass, per world unit.")
      .def_rw("opacity", &Material::opacity, "Of transparent surfaces.")
      .def_rw("emission", &Material::emission)
      .def_rw("shadow", &Material::shadow, nb::for_setter(nb::arg("value").none()),
              "Share of light that it takes from a shadow ray; None = as its kind does.");
}

void bind_light(nb::module_& module) {
  nb::class_<Light> type(module, "Light", "A light source.");
  def_keywords(type, "Light");
  type.def_prop_rw(
          "kind", [](const Light& l) { return name_of(kLightKinds, l.kind); },
          [](Light& l, const std::string& name) { l.kind = value_of(kLightKinds, "kind", name); },
          "'point', 'directional' or 'sphere'.")
      .def_rw("position", &Light::position)
      .def_rw("direction", &Light::direction, "In which a directional light shines.")
      .def_rw("color", &Light::color)
      .def_rw("radius", &Light::radius);
}

void bind_environment(nb::module_& module) {
  nb::class_<Environment> type(module, "Environment", "What rays that leave the scene see.");
  def_keywords(type, "Environment");
  type.def_rw("color", &Environment::color, "Constant, or factor of the picture.")
      .def_prop_rw(
          "equirect",
          [](const Environment& e) -> std::optional<FloatView> {
            if (e.equirect.data.empty()) return std::nullopt;
            return array_of(e.equirect);
          },
          [](Environment& e, const std::optional<FloatArray>& picture) {
            e.equirect = picture ? image_of(*picture, "equirect") : Image{};
          },
          nb::for_getter(nb::rv_policy::move), nb::for_setter(nb::arg("value").none()),
          "(height, width, 3), 360 degrees across; None = constant. Reading copies.")
      .def_prop_rw(
          "sky", [](const Environment& e) { return tuple_of(e.sky); },
          [](Environment& e, const SkyLight& sky) { e.sky = sky; },
          "As TraceOptions.sky, seen where there is no picture, times `color`.")
      .def_rw("up", &Environment::up)
      .def_rw("rotation", &Environment::rotation, "Degrees about `up`.");
}

void bind_settings(nb::module_& module) {
  nb::class_<ShadowSettings> shadows(module, "ShadowSettings", "Which shadows are cast.");
  def_keywords(shadows, "ShadowSettings");
  shadows.def_rw("mesh_on_mesh", &ShadowSettings::mesh_on_mesh)
      .def_rw("mesh_on_gaussians", &ShadowSettings::mesh_on_gaussians)
      .def_rw("gaussians_on_mesh", &ShadowSettings::gaussians_on_mesh)
      .def_rw("gaussians_on_gaussians", &ShadowSettings::gaussians_on_gaussians)
      .def_rw("strength", &ShadowSettings::strength, "0 = none, 1 = dark where no light comes.");
  nb::class_<RenderSettings> type(module, "RenderSettings", "How PathTracer draws.");
  def_keywords(type, "RenderSettings");
  type.def_rw("samples", &RenderSettings::samples, "Rays per pixel.")
      .def_rw("max_bounces", &RenderSettings::max_bounces)
      .def_rw("min_throughput", &RenderSettings::min_throughput)
      .def_rw("seed", &RenderSettings::seed)
      .def_rw("ambient", &RenderSettings::ambient)
      .def_rw("indirect", &RenderSettings::indirect)
      .def_rw("light_samples", &RenderSettings::light_samples)
      .def_rw("aperture", &RenderSettings::aperture)
      .def_rw("focus_distance", &RenderSettings::focus_distance)
      .def_rw("bias", &RenderSettings::bias)
      .def_rw("shadows", &RenderSettings::shadows);
}

std::vector<FloatView> textures(const Scene& scene) {
  std::vector<FloatView> out;
  for (const Image& each : scene.textures) out.push_back(array_of(each));
  return out;
}

void set_textures(Scene& scene, const std::vector<FloatArray>& pictures) {
  std::vector<Image> images;
  for (const FloatArray& each : pictures) images.push_back(image_of(each, "a texture"));
  scene.textures = std::move(images);
}

void bind_scene(nb::module_& module) {
  nb::class_<Scene> type(
      module, "Scene",
      "Gaussians, meshes, materials, lights and an environment for PathTracer. "
      "Gaussians and lists are read and set as a whole: what is read is a copy.");
  def_keywords(type, "Scene");
  // References would dangle once the attribute is set again.
  type.def_rw("gaussians", &Scene::gaussians, nb::for_getter(nb::rv_policy::copy))
      .def_rw("meshes", &Scene::meshes, nb::for_getter(nb::rv_policy::copy))
      .def_rw("materials", &Scene::materials, nb::for_getter(nb::rv_policy::copy))
      .def_prop_rw("textures", &textures, &set_textures, nb::for_getter(nb::rv_policy::move),
                   "Arrays (height, width, 3).")
      .def_rw("lights", &Scene::lights, nb::for_getter(nb::rv_policy::copy))
      .def_rw("environment", &Scene::environment)
      .def_rw("render", &Scene::render)
      .def_rw("trace", &Scene::trace);
}

void bind_mirrors(nb::module_& module) {
  nb::class_<Mirrors> type(
      module, "Mirrors",
      "Known mirrors for Tracer; every surface reflects from both sides, times "
      "the colour of its material. Lists are read and set as a whole, as those of Scene.");
  def_keywords(type, "Mirrors");
  type.def_rw("meshes", &Mirrors::meshes, nb::for_getter(nb::rv_policy::copy))
      .def_rw("materials", &Mirrors::materials, nb::for_getter(nb::rv_policy::copy))
      .def_rw("max_bounces", &Mirrors::max_bounces, "Mirrors that a ray may meet.");
}

void bind_loaded(nb::module_& module) {
  nb::class_<LoadedScene>(module, "LoadedScene", "A scene file (docs/scene.md) with what it names.")
      .def_static(
          "load",
          [](const std::filesystem::path& path) {
            SceneFile file = read_scene_file(path);
            find_models(file);
            return load_scene(file);
          },
          nb::arg("path"), nb::call_guard<nb::gil_scoped_release>(),
          "With the models, and traced, as `raysplats render` does.")
      .def_ro("scene", &LoadedScene::scene, "Meshes where they are in frame 0.")
      .def_ro("cameras", &LoadedScene::cameras, "One per frame.")
      .def_prop_ro("frames", &LoadedScene::frames)
      .def("meshes", &LoadedScene::meshes, nb::arg("frame"), "Those of a frame, in the world.");
}

}  // namespace

void bind_scenes(nb::module_& module) {
  bind_mesh(module);
  bind_material(module);
  bind_light(module);
  bind_environment(module);
  bind_settings(module);
  bind_scene(module);
  bind_mirrors(module);
  bind_loaded(module);
  module.def(
      "read_mesh",
      [](const std::filesystem::path& path) {
        io::MeshFile file;
        {
          const nb::gil_scoped_release release;
          file = io::read_mesh(path);
        }
        std::vector<FloatView> pictures;
        for (Image& each : file.textures) pictures.push_back(array_of(std::move(each)));
        return std::tuple(std::move(file.mesh), std::move(file.materials), std::move(pictures));
      },
      nb::arg("path"), "Mesh, materials and textures of an .obj, .ply, .gltf or .glb file.");
}

}  // namespace raysplats::python
