// SPDX-License-Identifier: Apache-2.0
// Numbers that are not finite, or finite and absurd, anywhere in a scene of light: a picture of
// finite numbers or an error.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"
#include "unit/light/light_fixture.hpp"

using namespace raysplats;

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::array<float, 10> kPoison{std::numeric_limits<float>::quiet_NaN(),
                                        kInfinity,
                                        -kInfinity,
                                        std::numeric_limits<float>::denorm_min(),
                                        1e38f,
                                        -1e38f,
                                        1e20f,
                                        1e3f,
                                        -1e3f,
                                        0.0f};

using Place = std::pair<std::string, std::function<float&(Scene&)>>;

/// A lit floor, a mirror, a ball of glass and a pane among a few Gaussians.
Scene small_scene() {
  Scene scene = cloud_scene();
  scene.lights = {lamp(), lamp()};
  scene.lights[0].kind = Light::Kind::kSphere;
  scene.lights[0].radius = 0.2f;
  scene.lights[1].kind = Light::Kind::kDirectional;
  const auto add = [&](Mesh mesh, Material::Kind kind) {
    Material material;
    material.kind = kind;
    material.specular = 0.3f;
    material.roughness = 0.2f;
    material.opacity = 0.6f;
    add_mesh(scene, std::move(mesh), material);
  };
  add(reference::rectangle({0, 0.9, 0}, {2, 0, 0}, {0, 0, 2}, 0), Material::Kind::kDiffuse);
  add(reference::ball({-0.5, 0, 0}, 0.4, 2, 0, true), Material::Kind::kGlass);
  add(reference::rectangle({0.6, 0, 0.3}, {0.3, 0, 0}, {0, 0.5, 0}, 0), Material::Kind::kMirror);
  add(reference::rectangle({0.2, 0, -0.8}, {0.5, 0, 0}, {0, 0.5, 0}, 0),
      Material::Kind::kTransparent);
  return scene;
}

std::vector<Place> places() {
  std::vector<Place> out;
  const auto gaussian = [&](const char* name, std::vector<float> Gaussians::*values,
                            std::size_t index) {
    out.emplace_back(name, [=](Scene& s) -> float& { return (s.gaussians.*values)[index]; });
  };
  gaussian("mean", &Gaussians::means, 4);
  gaussian("quaternion", &Gaussians::quaternions, 5);
  gaussian("log scale", &Gaussians::log_scales, 4);
  gaussian("opacity", &Gaussians::opacities, 1);
  gaussian("sh", &Gaussians::sh, 4);
  for (std::size_t m = 0; m < 4; ++m) {
    const std::string name = "material " + std::to_string(m) + " ";
    const auto material = [&](const char* field, float Material::*value) {
      out.emplace_back(name + field, [=](Scene& s) -> float& { return s.materials[m].*value; });
    };
    material("specular", &Material::specular);
    material("roughness", &Material::roughness);
    material("ior", &Material::ior);
    material("opacity", &Material::opacity);
    for (Rgb Material::*value : {&Material::color, &Material::absorption, &Material::emission}) {
      out.emplace_back(name + "colours",
                       [=](Scene& s) -> float& { return (s.materials[m].*value)[1]; });
    }
  }
  for (std::size_t l = 0; l < 2; ++l) {
    const std::string name = "light " + std::to_string(l) + " ";
    out.emplace_back(name + "position",
                     [=](Scene& s) -> float& { return s.lights[l].position[1]; });
    out.emplace_back(name + "direction",
                     [=](Scene& s) -> float& { return s.lights[l].direction[1]; });
    out.emplace_back(name + "color", [=](Scene& s) -> float& { return s.lights[l].color[1]; });
    out.emplace_back(name + "radius", [=](Scene& s) -> float& { return s.lights[l].radius; });
  }
  out.emplace_back("sky", [](Scene& s) -> float& { return s.environment.color[0]; });
  out.emplace_back("up", [](Scene& s) -> float& { return s.environment.up[1]; });
  out.emplace_back("ambient", [](Scene& s) -> float& { return s.render.ambient[2]; });
  out.emplace_back("bias", [](Scene& s) -> float& { return s.render.bias; });
  out.emplace_back("aperture", [](Scene& s) -> float& { return s.render.aperture; });
  out.emplace_back("focus", [](Scene& s) -> float& { return s.render.focus_distance; });
  out.emplace_back("position", [](Scene& s) -> float& { return s.meshes[0].positions[3]; });
  return out;
}

bool all_finite(const Image& image) {
  return std::all_of(image.data.begin(), image.data.end(),
                     [](float value) { return std::isfinite(value); });
}

// Whether `render` makes a picture of finite numbers or throws an error of ours.
template <class Render>
bool is_clean(Render render) {
  try {
    return all_finite(render());
  } catch (const Error&) {
    return true;
  }
}

}  // namespace

TEST_CASE("poison: any number in a scene makes a clean picture or an error") {
  Context context = make_test_context();
  const Scene sound = small_scene();
  const Camera camera = reference::cube_camera(6, 5);
  REQUIRE(all_finite(render_on_device(context, sound, camera)));
  for (const auto& [name, place] : places()) {
    for (const float value : kPoison) {
      const std::string what = name + " = " + std::to_string(value);
      CAPTURE(what);
      Scene scene = sound;
      place(scene) = value;
      CHECK(is_clean([&] { return render_on_device(context, scene, camera); }));
    }
  }
}

TEST_CASE("poison: any number in a camera of a scene makes a clean picture or an error") {
  Context context = make_test_context();
  PathTracer tracer(context, small_scene());
  const auto renders = [&](const Camera& camera) {
    return is_clean([&] { return tracer.render(camera); });
  };
  for (const CameraModel model : {CameraModel::kPinhole, CameraModel::kFisheye,
                                  CameraModel::kEquirectangular, CameraModel::kOrthographic}) {
    for (const float value : kPoison) {
      CAPTURE(static_cast<int>(model));
      CAPTURE(value);
      Camera sound = reference::cube_camera(6, 5);
      sound.model = model;
      for (double Camera::*number : {&Camera::fx, &Camera::fy, &Camera::cx, &Camera::cy}) {
        Camera camera = sound;
        camera.*number = value;
        CHECK(renders(camera));
      }
      Camera camera = sound;
      camera.translation[1] = value;
      CHECK(renders(camera));
      camera = sound;
      camera.rotation[1][2] = value;
      CHECK(renders(camera));
      camera = sound;
      camera.distortion.k1 = value;
      CHECK(renders(camera));
    }
  }
}
