// SPDX-License-Identifier: Apache-2.0
// Paths through Gaussians and a mesh: a ball that is behind the camera, seen in a mirror before it.
#include <raysplats/context.hpp>
#include <raysplats/error.hpp>
#include <raysplats/io.hpp>
#include <raysplats/path_tracer.hpp>

#include <cmath>
#include <cstdio>

namespace {

// A square mirror that reflects 80 % of the light, across the z axis at z = 2.
raysplats::Mesh mirror() {
  raysplats::Mesh mesh;
  mesh.positions = {-2, -2, 2, 2, -2, 2, 2, 2, 2, -2, 2, 2};
  mesh.triangles = {0, 1, 2, 0, 2, 3};
  mesh.materials = {0, 0};
  return mesh;
}

bool near(const char* what, float value, float expected) {
  std::printf("%s: %.5f (expected %.5f)\n", what, static_cast<double>(value),
              static_cast<double>(expected));
  return std::abs(value - expected) < 1e-4f;
}

}  // namespace

int main() {
  try {
    using namespace raysplats;
    Scene scene;
    // White, opacity 0.9, at z = -3.
    scene.gaussians.resize(1);
    scene.gaussians.means = {0, 0, -3};
    scene.gaussians.log_scales.assign(3, std::log(0.3f));
    scene.gaussians.opacities[0] = std::log(0.9f / 0.1f);
    scene.gaussians.sh.assign(3, 1.7724539f);
    scene.meshes.push_back(mirror());
    scene.materials.resize(1);
    scene.materials[0].kind = Material::Kind::kMirror;
    scene.materials[0].color = {0.8f, 0.8f, 0.8f};
    scene.environment.color = {0.1f, 0.2f, 0.4f};

    Context context(select_device(""));
    PathTracer tracer(context, scene);
    // The camera is between them and looks at the mirror.
    const Camera camera = look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 81, 61, 60.0);
    const Image picture = tracer.render(camera);
    write_image("mirror.png", picture);
    std::printf("mirror.png, %d rays reflected\n",
                static_cast<int>(tracer.statistics().continued_rays));

    // In the middle the ray comes back through the camera and meets the ball's centre; the rest of
    // it sees the environment, which the mirror shows too.
    bool good = near("red in the middle", picture.at(40, 30, 0), 0.8f * (0.9f + 0.1f * 0.1f));
    good = near("blue in the middle", picture.at(40, 30, 2), 0.8f * (0.9f + 0.1f * 0.4f)) && good;
    good = near("blue of the mirrored sky", picture.at(75, 30, 2), 0.8f * 0.4f) && good;

    // An animation's next frame: without the mirror there is only sky.
    tracer.set_meshes({});
    good = near("blue without the mirror", tracer.render(camera).at(40, 30, 2), 0.4f) && good;
    return good ? 0 : 1;
  } catch (const raysplats::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return error.exit_code();
  }
}
