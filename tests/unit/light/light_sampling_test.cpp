// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include "raysplats/error.hpp"
#include "unit/light/light_fixture.hpp"

using namespace raysplats;
using reference::ball;
using reference::box;
using reference::cube_camera;
using reference::glass;
using reference::rectangle;
using reference::white;

namespace {

Scene white_sky() {
  Scene scene;
  scene.environment.color = {1, 1, 1};
  scene.render.ambient = {0, 0, 0};
  scene.render.max_bounces = 40;
  scene.render.min_throughput = 0.0f;
  return scene;
}

/// Mean and its standard error over pictures of different seeds, value by value.
struct Estimate {
  std::vector<double> mean, error;
};

Estimate estimate(Context& context, Scene scene, const Camera& camera, int seeds) {
  Estimate out;
  std::vector<double> squares;
  for (int k = 0; k < seeds; ++k) {
    scene.render.seed = static_cast<std::uint64_t>(100 + k);
    const Image image = render_on_device(context, scene, camera);
    out.mean.resize(image.data.size());
    squares.resize(image.data.size());
    for (std::size_t i = 0; i < image.data.size(); ++i) {
      out.mean[i] += image.data[i] / static_cast<double>(seeds);
      squares[i] += static_cast<double>(image.data[i]) * image.data[i] / seeds;
    }
  }
  for (std::size_t i = 0; i < squares.size(); ++i) {
    const double variance = std::max(0.0, squares[i] - out.mean[i] * out.mean[i]);
    out.error.push_back(std::sqrt(variance / (seeds - 1)));
  }
  return out;
}

/// Of values that scatter at all: the share farther than three standard errors from what is
/// expected.
double share_beyond_three_sigma(const Estimate& found, const std::vector<double>& expected) {
  std::size_t beyond = 0, counted = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (found.error[i] < 1e-6) continue;
    ++counted;
    beyond += std::abs(found.mean[i] - expected[i]) > 3.0 * found.error[i] ? 1 : 0;
  }
  REQUIRE(counted > 50);
  return static_cast<double>(beyond) / static_cast<double>(counted);
}

/// Facets with smooth normals keep a few rays in by total reflection, for good: `lost` of all.
void check_white_sky(const Camera& camera, int segments, double lost) {
  Context context = make_test_context();
  const auto check = [&](const Scene& scene, const char* what, double mean_tolerance) {
    CAPTURE(what);
    const Image image = render_on_device(context, scene, camera);
    const auto mean = mean_of(image);
    for (std::size_t c = 0; c < 3; ++c) CHECK(std::abs(mean[c] - 1.0) < mean_tolerance);
    CHECK(std::abs(mean[3]) < mean_tolerance);
    float highest = 0;
    for (std::size_t i = 0; i < image.data.size(); ++i) {
      if (i % 4 < 3) highest = std::max(highest, image.data[i]);
    }
    CHECK(highest < 1.0f + 1e-5f);
  };
  Scene scene = white_sky();
  add_mesh(scene, ball({0, 0, 0}, 1, segments, 0, true), white(Material::Kind::kMirror));
  check(scene, "mirror ball", 1e-6);
  scene = white_sky();
  add_mesh(scene, ball({0, 0, 0}, 1, segments, 0, true), glass(1.5f));
  check(scene, "glass ball", lost);
  scene = white_sky();
  add_mesh(scene, rectangle({0.1, 0, 1.3}, {1, 0, 0.2}, {0, 1, 0.1}, 0),
           white(Material::Kind::kMirror));
  add_mesh(scene, box({-0.8, -0.7, -0.5}, {0.6, 0.7, 0.5}, 0), glass(1.33f));
  check(scene, "glass box before a mirror", lost);
  scene = white_sky();
  scene.render.samples = 8;
  Material rough = white(Material::Kind::kMirror);
  rough.roughness = 0.5f;
  add_mesh(scene, ball({0, 0, 0}, 1, segments, 0, true), rough);
  check(scene, "rough mirror ball", 1e-5);
}

}  // namespace

TEST_CASE("a white sky stays white through clear glass and mirrors") {
  check_white_sky(kCamera, 12, 2e-2);
}

TEST_CASE("a few rays of a white sky stay white through clear glass and mirrors [small]") {
  check_white_sky(cube_camera(3, 3), 4, 5e-2);
}

TEST_CASE("glass of index 1 without absorption changes nothing on the device") {
  Context context = make_test_context();
  Scene scene = cloud_scene(1);
  scene.trace.min_transmittance = 1e-6f;
  const Image plain = render_on_device(context, scene, kCamera);
  add_mesh(scene, ball({0, 0, 0}, 0.7, 8, 0, true), glass(1.0f));
  add_mesh(scene, box({-0.5, -0.8, -0.3}, {0.9, 0.3, 0.4}, 0), glass(1.0f));
  CHECK(largest_difference(plain, render_on_device(context, scene, kCamera)) < 2e-5);
  // And bit for bit where no Gaussian is cut.
  scene.gaussians = Gaussians{};
  Scene bare = scene;
  bare.meshes.clear();
  CHECK(largest_difference(render_on_device(context, bare, kCamera),
                           render_on_device(context, scene, kCamera)) == 0.0);
}

TEST_CASE("an opaque mesh hides exactly the Gaussians behind it on the device") {
  Context context = make_test_context();
  Scene scene;
  Material black;
  black.kind = Material::Kind::kEmissive;
  add_mesh(scene, rectangle({0, 0, 0}, {4, 0, 0}, {0, 4, 0}, 0), black);
  const Gaussians front = reference::gaussian_cloud(40, 5, {-1, -1, -2}, {1, 1, -0.8}, 0.1);
  const Gaussians behind = reference::gaussian_cloud(60, 6, {-1, -1, 0.8}, {1, 1, 2}, 0.1);
  Gaussians both = front;
  const auto append = [](std::vector<float>& to, const std::vector<float>& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  append(both.means, behind.means);
  append(both.quaternions, behind.quaternions);
  append(both.log_scales, behind.log_scales);
  append(both.opacities, behind.opacities);
  append(both.sh, behind.sh);
  scene.gaussians = front;
  const Image without = render_on_device(context, scene, kCamera);
  scene.gaussians = both;
  const Image with = render_on_device(context, scene, kCamera);
  CHECK(largest_difference(with, without) == 0.0);
  CHECK(mean_of(with)[0] > 0.05);
  for (std::size_t i = 3; i < with.data.size(); i += 4) CHECK(with.data[i] == 1.0f);
}

TEST_CASE("a seed reproduces its picture, another differs, set_meshes equals a new tracer") {
  Context context = make_test_context();
  Scene scene = cloud_scene();
  scene.lights = {lamp()};
  scene.lights[0].kind = Light::Kind::kSphere;
  scene.lights[0].radius = 0.5f;
  add_mesh(scene, ball({0, 0, 0}, 0.7, 8, 0, true), glass(1.5f));
  add_mesh(scene, rectangle({0, 1.1, 0}, {3, 0, 0}, {0, 0.1, 3}, 0), Material{});
  scene.render.samples = 3;
  PathTracer tracer(context, scene);
  const Image first = tracer.render(kCamera);
  CHECK(largest_difference(first, tracer.render(kCamera)) == 0.0);
  CHECK(largest_difference(first, render_on_device(context, scene, kCamera)) == 0.0);
  Scene other = scene;
  other.render.seed = 1;
  CHECK(largest_difference(first, render_on_device(context, other, kCamera)) > 1e-2);

  Scene moved = scene;
  moved.render.bias = scene.render.bias = 0.01f;
  moved.meshes[0] = ball({0.3, -0.2, 0}, 0.5, 6, 0, false);
  PathTracer animated(context, scene);
  animated.set_meshes(moved.meshes);
  CHECK(largest_difference(animated.render(kCamera), render_on_device(context, moved, kCamera)) ==
        0.0);
  animated.set_meshes({});
  moved.meshes.clear();
  CHECK(largest_difference(animated.render(kCamera), render_on_device(context, moved, kCamera)) ==
        0.0);
}

TEST_CASE("a batch of pixels at a time draws the same picture") {
  Context context = make_test_context();
  Scene scene = cloud_scene();
  scene.lights = {lamp()};
  scene.lights[0].kind = Light::Kind::kSphere;
  scene.lights[0].radius = 0.5f;
  add_mesh(scene, ball({0, 0, 0}, 0.7, 8, 0, true), glass(1.5f));
  scene.render.samples = 2;
  const Image whole = render_on_device(context, scene, kCamera);
  scene.trace.memory_budget = std::size_t{1} << 19;
  CHECK(largest_difference(whole, render_on_device(context, scene, kCamera)) < 1e-6);
}

TEST_CASE("many samples tend to the reference's mean over the pixel") {
  Context context = make_test_context();
  Scene scene = cloud_scene();
  scene.lights = {lamp()};
  add_mesh(scene, ball({0.1, 0, 0}, 0.7, 6, 0, true), glass(1.5f));
  add_mesh(scene, rectangle({0, 1.1, 0}, {3, 0, 0}, {0, 0.1, 3}, 0), Material{});
  // Later surfaces choose by chance here, and count with their probabilities there.
  scene.render.max_bounces = 5;
  const Camera camera = cube_camera(8, 8);
  scene.render.samples = 16;
  const Estimate found = estimate(context, scene, camera, 16);
  constexpr int kFine = 16;
  const Camera fine = cube_camera(8 * kFine, 8 * kFine);
  const reference::LightRender dense = reference::render_light(scene, fine);
  std::vector<double> expected(4 * 64);
  double mean_found = 0, mean_expected = 0;
  for (std::size_t i = 0; i < dense.pixels(); ++i) {
    const std::size_t x = i % (8 * kFine) / kFine, y = i / (8 * kFine) / kFine;
    for (std::size_t c = 0; c < 4; ++c) {
      expected[4 * (8 * y + x) + c] += dense.image[c * dense.pixels() + i] / (kFine * kFine);
    }
  }
  for (std::size_t i = 0; i < expected.size(); ++i) {
    mean_found += found.mean[i] / static_cast<double>(expected.size());
    mean_expected += expected[i] / static_cast<double>(expected.size());
  }
  MESSAGE("means ", mean_found, " and ", mean_expected);
  CHECK(mean_found == doctest::Approx(mean_expected).epsilon(5e-3));
  // The reference's own points leave an error too, so that the share is above the 0.3 % of
  // chance.
  CHECK(share_beyond_three_sigma(found, expected) < 0.06);
}

TEST_CASE("later glass surfaces choose by Fresnel's share") {
  Context context = make_test_context();
  Scene scene;
  scene.render.ambient = {0, 0, 0};
  scene.render.samples = 64;
  add_mesh(scene, box({-9, -9, 0}, {9, 9, 0.3}, 0), glass(2.5f));
  add_mesh(scene, box({-9, -9, 0.6}, {9, 9, 0.8}, 0), glass(3.5f));
  Material glow = white(Material::Kind::kEmissive);
  glow.emission = {1, 1, 1};
  add_mesh(scene, rectangle({0, 0, 2}, {30, 0, 0}, {0, 30, 0}, 0), glow);
  const Camera camera = cube_camera(6, 6);
  for (const int bounces : {5, 8}) {
    scene.render.max_bounces = bounces;
    const double found = mean_of(render_on_device(context, scene, camera))[0];
    const reference::LightRender dense = reference::render_light(scene, camera);
    double expected = 0, chance = 0;
    for (std::size_t i = 0; i < dense.pixels(); ++i) {
      expected += dense.image[i] / static_cast<double>(dense.pixels());
      chance += dense.chance[i] / static_cast<double>(dense.pixels());
    }
    CHECK(chance > 0.5);
    // 2304 samples of a value in [0, 1]: a standard error below 0.01.
    CHECK(std::abs(found - expected) < 0.03);
  }
}

TEST_CASE("a sphere light's shadow is the visible share of its disc on average") {
  Context context = make_test_context();
  Scene scene;
  scene.gaussians = reference::gaussian_cloud(12, 4, {-0.6, -1.2, -0.6}, {0.6, -0.6, 0.6}, 0.12);
  Light light = lamp();
  light.kind = Light::Kind::kSphere;
  light.radius = 0.6f;
  light.position = {0.4f, -2.5f, -0.4f};
  scene.lights = {light};
  scene.render.shadows.gaussians_on_gaussians = true;
  scene.render.shadows.strength = 1.0f;
  scene.render.light_samples = 8;
  add_mesh(scene, rectangle({0, 1.1, 0}, {2, 0, 0}, {0, 0.1, 3}, 0), Material{});
  add_mesh(scene, box({-0.5, -0.2, -0.4}, {0.3, 0.2, 0.5}, 0), Material{});
  const Camera camera = look_at({0.5, -2.5, -4}, {0, 0.6, 0}, {0, -1, 0}, 16, 16, 18.0);
  const Estimate found = estimate(context, scene, camera, 24);
  const reference::LightRender dense = reference::render_light(scene, camera);
  std::vector<double> expected(4 * dense.pixels());
  double mean_found = 0, mean_expected = 0;
  for (std::size_t i = 0; i < dense.pixels(); ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      expected[4 * i + c] = dense.image[c * dense.pixels() + i];
      mean_found += found.mean[4 * i + c];
      mean_expected += expected[4 * i + c];
    }
    // Fully lit and fully dark points do not scatter and must be exact.
    if (found.error[4 * i] < 1e-6 && dense.margin[i] > 1e-4) {
      CHECK(std::abs(found.mean[4 * i] - expected[4 * i]) < 0.02 * std::max(1.0, expected[4 * i]));
    }
  }
  CHECK(mean_found == doctest::Approx(mean_expected).epsilon(3e-3));
  CHECK(share_beyond_three_sigma(found, expected) < 0.04);
}

TEST_CASE("indirect light keeps the energy of a white sky") {
  Context context = make_test_context();
  Scene scene = white_sky();
  scene.render.indirect = true;
  scene.render.ambient = {5, 5, 5};  // replaced
  Material grey;
  grey.color = {0.6f, 0.3f, 1.0f};
  add_mesh(scene, ball({0, 0, 0}, 0.9, 10, 0, false), grey);
  // Every ray from a convex body leaves it: no noise.
  const Image image = render_on_device(context, scene, cube_camera(9, 9));
  CHECK(image.at(4, 4, 0) == doctest::Approx(0.6).epsilon(1e-5));
  CHECK(image.at(4, 4, 1) == doctest::Approx(0.3).epsilon(1e-5));
  CHECK(image.at(4, 4, 2) == doctest::Approx(1.0).epsilon(1e-5));
  CHECK(image.at(4, 4, 3) == doctest::Approx(1.0 - (0.6 + 0.3 + 1.0) / 3.0).epsilon(1e-5));
  CHECK(image.at(0, 0, 0) == 1.0f);

  // Gaussians light a floor: one opaque white wall of them over half of the sky, which is black.
  Scene room;
  room.render.ambient = {5, 5, 5};
  room.render.indirect = true;
  room.render.samples = 64;
  add_mesh(room, rectangle({0, 1, 0}, {9, 0, 0}, {0, 0, 9}, 0), white(Material::Kind::kDiffuse));
  for (int x = -12; x <= 12; ++x) {
    for (int z = -12; z <= 12; ++z) {
      reference::add_gaussian(room.gaussians, {0.3 * x, -1.5, 0.3 * z}, 0.3, 0.999, {1, 1, 1});
    }
  }
  // A square of half side a at height h over a point sends the share below of a cosine-weighted
  // hemisphere (the form factor of a rectangle seen from under its centre).
  const Camera down = look_at({0, 0.4, 0}, {0, 1, 0}, {0, 0, 1}, 2, 2, 40.0);
  const auto mean = mean_of(render_on_device(context, room, down));
  const double a = 3.6 + 0.3, h = 2.5;
  const double r = std::sqrt(a * a + h * h);
  const double share = 4.0 / 3.14159265 * (a / r) * std::atan(a / r);
  CHECK(mean[0] == doctest::Approx(share).epsilon(0.06));
}

TEST_CASE("a thin lens is sharp at its focus alone") {
  Context context = make_test_context();
  Scene scene;
  Material painted = white(Material::Kind::kDiffuse);
  painted.texture = 0;
  scene.materials = {painted};
  scene.render.ambient = {1, 1, 1};
  Image checks(8, 8, 3);
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      for (int c = 0; c < 3; ++c) checks.at(x, y, c) = static_cast<float>((x + y) % 2);
    }
  }
  scene.textures = {checks};
  scene.meshes = {rectangle({0, 0, 0}, {2, 0, 0}, {0, 2, 0}, 0)};
  scene.render.samples = 4;
  const Image pinhole = render_on_device(context, scene, kCamera);
  scene.render.aperture = 0.3f;
  scene.render.focus_distance = 4.0f;
  CHECK(largest_difference(pinhole, render_on_device(context, scene, kCamera)) < 1e-4);
  scene.render.focus_distance = 2.0f;
  CHECK(largest_difference(pinhole, render_on_device(context, scene, kCamera)) > 0.1);
  // One sample goes through the lens's centre.
  scene.render.samples = 1;
  const Image centre = render_on_device(context, scene, kCamera);
  // One of many goes anywhere through it.
  PathTracer tracer(context, scene);
  tracer.set_sampling(1, scene.render.seed, true);
  CHECK(largest_difference(centre, tracer.render(kCamera)) > 0.1);
  tracer.set_sampling(1, scene.render.seed);
  CHECK(largest_difference(centre, tracer.render(kCamera)) == 0.0);
  scene.render.aperture = 0.0f;
  CHECK(largest_difference(centre, render_on_device(context, scene, kCamera)) == 0.0);
}

TEST_CASE("rays are counted") {
  Context context = make_test_context();
  Scene scene;
  Light sun;
  sun.kind = Light::Kind::kDirectional;
  sun.direction = {0, 0, 1};
  scene.lights = {sun};
  add_mesh(scene, rectangle({0, 0, 0}, {9, 0, 0}, {0, 9, 0}, 0), Material{});
  PathTracer lit(context, scene);
  lit.render(kCamera);
  CHECK(lit.statistics().camera_rays == 576);
  CHECK(lit.statistics().shadow_rays == 576);
  CHECK(lit.statistics().continued_rays == 0);
  CHECK(lit.statistics().ended_by_bounces == 0);
  scene.materials[0].kind = Material::Kind::kMirror;
  scene.render.samples = 2;
  PathTracer reflecting(context, scene);
  reflecting.render(kCamera);
  CHECK(reflecting.statistics().camera_rays == 2 * 576);
  CHECK(reflecting.statistics().continued_rays == 2 * 576);
  CHECK(reflecting.statistics().shadow_rays == 0);
  scene.render.max_bounces = 1;
  PathTracer ended(context, scene);
  ended.render(kCamera);
  CHECK(ended.statistics().continued_rays == 0);
  CHECK(ended.statistics().ended_by_bounces == 2 * 576);
}

TEST_CASE("settings and meshes that make no sense are refused") {
  Context context = make_test_context();
  Scene sound = cloud_scene();
  add_mesh(sound, ball({0, 0, 0}, 0.7, 4, 0, true), Material{});
  const auto usage = [&](auto&& change) {
    Scene scene = sound;
    change(scene);
    CHECK_THROWS_AS(PathTracer(context, scene), UsageError);
  };
  usage([](Scene& s) { s.render.samples = 0; });
  usage([](Scene& s) { s.render.max_bounces = 0; });
  usage([](Scene& s) { s.render.light_samples = 0; });
  usage([](Scene& s) { s.render.aperture = -1.0f; });
  usage([](Scene& s) { s.render.shadows.strength = 1.5f; });
  usage([](Scene& s) { s.render.min_throughput = -0.1f; });
  usage([](Scene& s) { s.render.min_throughput = std::numeric_limits<float>::quiet_NaN(); });
  const auto data = [&](auto&& change) {
    Scene scene = sound;
    change(scene);
    CHECK_THROWS_AS(PathTracer(context, scene), DataError);
  };
  data([](Scene& s) { s.meshes[0].positions[4] = std::numeric_limits<float>::quiet_NaN(); });
  data([](Scene& s) { s.meshes[0].triangles[5] = 100000; });
  data([](Scene& s) { s.meshes[0].materials[2] = 1; });
  data([](Scene& s) { s.gaussians.means[1] = std::numeric_limits<float>::quiet_NaN(); });
  usage([](Scene& s) { s.gaussians.opacities.pop_back(); });
  usage([](Scene& s) {
    s.lights.resize(1);
    s.lights[0].position[2] = std::numeric_limits<float>::infinity();
  });
  PathTracer tracer(context, sound);
  Camera camera = kCamera;
  camera.translation.x = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(tracer.render(camera), UsageError);
}
