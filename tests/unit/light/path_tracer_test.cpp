// SPDX-License-Identifier: Apache-2.0
#include "raysplats/path_tracer.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <stdexcept>
#include <thread>
#include <vector>

#include "light/view_tracer.hpp"
#include "raysplats/error.hpp"
#include "trace/camera_tracer.hpp"
#include "unit/light/light_fixture.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using reference::ball;
using reference::box;
using reference::cube_camera;
using reference::rectangle;
using reference::white;

TEST_CASE("Gaussians alone are drawn along their rays before the environment [small]") {
  Context context = make_test_context();
  Scene scene = cloud_scene(2);
  scene.trace.background = {3, 3, 3};  // has no meaning here
  check_picture(context, scene, kCamera, "entry order");
  scene.trace.hit_order = HitOrder::kPeak;
  check_picture(context, scene, kCamera, "peak order");
  scene.lights = {lamp()};
  check_picture(context, scene, kCamera, "a lamp without shadows");
  scene.gaussians = Gaussians{};
  check_picture(context, scene, kCamera, "nothing at all");
}

TEST_CASE("an opaque mesh is drawn within the cloud") {
  Context context = make_test_context();
  Scene scene = cloud_scene();
  Material lit = diffuse({0.7f, 0.2f, 0.4f});
  lit.emission = {0.0f, 0.05f, 0.1f};
  add_mesh(scene, ball({0.2, 0.1, 0}, 0.7, 8, 0, true), lit);
  add_floor(scene);
  check_picture(context, scene, kCamera, "ambient alone");
  scene.lights = {lamp()};
  scene.render.shadows.strength = 0.0f;
  check_picture(context, scene, kCamera, "a lamp");
  Light sun;
  sun.kind = Light::Kind::kDirectional;
  sun.direction = {-1, 2, 0.5};
  sun.color = {0.3f, 0.4f, 0.5f};
  scene.lights.push_back(sun);
  scene.materials[0].specular = 0.6f;
  scene.materials[0].roughness = 0.4f;
  check_picture(context, scene, kCamera, "two lights and a highlight");
  scene.materials[0].roughness = 0.9f;  // wide enough to reach behind the terminator
  check_picture(context, scene, kCamera, "a wide highlight");
  scene.trace.hit_order = HitOrder::kPeak;
  check_picture(context, scene, kCamera, "peak order");
}

TEST_CASE("a glowing mesh without Gaussians is exact") {
  Context context = make_test_context();
  Scene scene;
  Material glow = white(Material::Kind::kEmissive);
  glow.emission = {0.5f, 1.0f, 2.0f};
  add_mesh(scene, box({-0.6, -0.5, -0.4}, {0.5, 0.7, 0.6}, 0), glow);
  check_picture(context, scene, kCamera, "box", 1e-6, 0.02);
}

TEST_CASE("shadows of all four kinds") {
  Context context = make_test_context();
  Scene scene = cloud_scene();
  add_mesh(scene, ball({0.2, -0.2, -0.1}, 0.5, 6, 0, true), diffuse({0.7f, 0.2f, 0.4f}));
  add_floor(scene);
  Material veil = diffuse({0.2f, 0.9f, 0.3f});
  veil.kind = Material::Kind::kTransparent;
  veil.opacity = 0.4f;
  add_mesh(scene, rectangle({0.6, -1.3, -1}, {0.5, 0, 0.1}, {0, 0.1, 0.6}, 0), veil);
  scene.lights = {lamp()};
  Light sun;
  sun.kind = Light::Kind::kDirectional;
  sun.direction = {-0.5f, 1.0f, 0.3f};
  scene.lights.push_back(sun);
  scene.render.bias = 0.02f;
  scene.render.shadows = {false, false, false, false, 0.8f};
  const auto check = [&](const char* what) { check_picture(context, scene, kCamera, what); };
  check("none");
  scene.render.shadows = {true, false, false, false, 0.8f};
  check("mesh on mesh");
  scene.render.shadows = {false, true, false, false, 0.8f};
  check("mesh on Gaussians");
  scene.render.shadows = {false, false, true, false, 0.8f};
  check_picture(context, scene, kCamera, "Gaussians on mesh");
  scene.render.shadows = {false, false, false, true, 0.8f};
  check_picture(context, scene, kCamera, "Gaussians on Gaussians");
  scene.render.shadows = {true, true, true, true, 1.0f};
  check_picture(context, scene, kCamera, "all");
  scene.trace.hit_order = HitOrder::kPeak;
  scene.render.bias = 0.0f;
  check_picture(context, scene, kCamera, "all in peak order");
}

TEST_CASE("a Gaussian far away takes no shadow of a mesh off the others") {
  Context context = make_test_context();
  // A wall, a shade before it, and light that comes from the side.
  Scene scene;
  Gaussians& wall = scene.gaussians;
  constexpr std::size_t kSide = 20;
  wall.resize(kSide * kSide + 1);
  for (std::size_t i = 0; i < wall.size(); ++i) {
    wall.means[3 * i] = 0.1f * static_cast<float>(i % kSide) - 0.95f;
    wall.means[3 * i + 1] = 0.1f * static_cast<float>(i / kSide) - 0.95f;
    for (std::size_t k = 0; k < 3; ++k)
      wall.log_scales[3 * i + k] = std::log(k < 2 ? 0.08f : 0.01f);
    wall.quaternions[4 * i] = 1.0f;
    wall.opacities[i] = 3.0f;
    for (std::size_t k = 0; k < 3; ++k) wall.sh[3 * i + k] = 1.7725f;
  }
  add_mesh(scene, rectangle({-0.3, 0, -0.3}, {0.2, 0, 0}, {0, 0.4, 0}, 0), diffuse({0, 0, 0}));
  Light sun;
  sun.kind = Light::Kind::kDirectional;
  sun.direction = {0.8f, 0.0f, 1.0f};
  scene.lights = {sun};
  scene.render.shadows.strength = 1.0f;
  const Camera camera = look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 32, 32, 60.0);
  wall.means[3 * (wall.size() - 1)] = 30.0f;
  const Image near = render_on_device(context, scene, camera);
  wall.means[3 * (wall.size() - 1)] = 1e5f;
  const Image far = render_on_device(context, scene, camera);
  scene.render.shadows.strength = 0.0f;
  const double bare = mean_of(render_on_device(context, scene, camera))[0];
  CHECK(mean_of(near)[0] < 0.97 * bare);
  CHECK(mean_of(far)[0] == doctest::Approx(mean_of(near)[0]).epsilon(0.005));
}

TEST_CASE("a surface of Gaussians throws no speckle on itself, and its dark side is dark") {
  Context context = make_test_context();
  // Flat Gaussians of all sizes on a ball, white.
  Scene scene;
  Gaussians& model = scene.gaussians;
  CounterRng rng(11, 0);
  const auto vector = [&] { return glm::dvec3(rng.normal(), rng.normal(), rng.normal()); };
  for (int i = 0; i < 4000; ++i) {
    const glm::dvec3 place = glm::normalize(vector()) * (1.0 + 0.02 * rng.normal());
    const glm::dvec3 normal =
        glm::normalize(glm::normalize(place) + 0.2 * glm::normalize(vector()));
    // The turn of z to the normal.
    const glm::dquat turn =
        glm::normalize(glm::dquat(1.0 + normal.z, glm::cross(glm::dvec3(0, 0, 1), normal)));
    for (int k = 0; k < 3; ++k) {
      model.means.push_back(static_cast<float>(place[k]));
      model.log_scales.push_back(
          static_cast<float>(std::log(k < 2 ? 0.04 : 0.008) + 0.3 * rng.normal()));
      model.sh.push_back(1.7725f);  // colour 1
    }
    for (const double part : {turn.w, turn.x, turn.y, turn.z})
      model.quaternions.push_back(static_cast<float>(part));
    model.opacities.push_back(static_cast<float>(1.5 + 1.5 * rng.normal()));
  }
  Light sun;
  sun.kind = Light::Kind::kDirectional;
  sun.direction = {-0.6f, 0.6f, 0.55f};
  scene.lights = {sun};
  const Camera camera = look_at({0, 0, -6}, {0, 0, 0}, {0, -1, 0}, 48, 48, 100);
  const glm::dvec3 towards = -glm::normalize(glm::dvec3(-0.6, 0.6, 0.55));
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    scene.trace.hit_order = order;
    scene.render.shadows = {false, false, false, false, 1.0f};
    const Image bare = render_on_device(context, scene, camera);
    scene.render.shadows.gaussians_on_gaussians = true;
    const Image shaded = render_on_device(context, scene, camera);
    double lit = 0, lit_squares = 0, dark = 0;
    int lit_pixels = 0, dark_pixels = 0;
    for (int y = 0; y < 48; ++y) {
      for (int x = 0; x < 48; ++x) {
        // Where the pixel's ray meets the ball.
        const glm::dvec3 d =
            glm::normalize(glm::transpose(camera.rotation) *
                           glm::dvec3((x + 0.5 - 24) / 100, (y + 0.5 - 24) / 100, 1));
        const glm::dvec3 eye = camera.center();
        const double b = glm::dot(eye, d), c = glm::dot(eye, eye) - 1.0;
        if (b * b < c || bare.at(x, y, 0) < 0.5f) continue;
        const double facing = glm::dot(eye - (b + std::sqrt(b * b - c)) * d, towards);
        const double share =
            static_cast<double>(shaded.at(x, y, 0)) / static_cast<double>(bare.at(x, y, 0));
        if (facing > 0.35) {
          lit += share;
          lit_squares += share * share;
          ++lit_pixels;
        } else if (facing < -0.35) {
          dark += share;
          ++dark_pixels;
        }
      }
    }
    REQUIRE(lit_pixels > 100);
    REQUIRE(dark_pixels > 20);
    const double mean = lit / lit_pixels;
    const double deviation = std::sqrt(std::max(0.0, lit_squares / lit_pixels - mean * mean));
    MESSAGE("lit ", mean, " +- ", deviation, ", dark ", dark / dark_pixels);
    CHECK(mean > 0.97);
    CHECK(deviation < 0.12);
    CHECK(dark / dark_pixels < 0.1);
  }
}

TEST_CASE("camera rays in packets and ray by ray give the same picture, through every lens") {
  Context context = make_test_context();
  Scene scene = cloud_scene(1);
  for (const bool with_mesh : {false, true}) {
    scene.render.samples = with_mesh ? 1 : 3;
    if (with_mesh) {
      add_mesh(scene, ball({0.2, 0.1, 0}, 0.6, 8, 0, true), white(Material::Kind::kMirror));
      add_mesh(scene, rectangle({0, 0, -0.7}, {0.4, 0.1, 0}, {0, 0.3, 0.2}, 0),
               diffuse({0.7f, 0.2f, 0.4f}));
    }
    for (const CameraModel model :
         {CameraModel::kPinhole, CameraModel::kOpenCv, CameraModel::kFisheye}) {
      CAPTURE(with_mesh);
      CAPTURE(static_cast<int>(model));
      Camera camera = cube_camera(45, 37);
      camera.model = model;
      if (model != CameraModel::kPinhole) camera.distortion.k1 = 0.02;
      scene.trace.traversal = Traversal::kAuto;
      scene.trace.max_hits = 3;
      PathTracer by_packets(context, scene);
      const Image packets = by_packets.render(camera);
      scene.trace.traversal = Traversal::kBvh;
      PathTracer by_rays(context, scene);
      const Image rays = by_rays.render(camera);
      std::size_t apart = 0;
      for (std::size_t i = 0; i < rays.data.size(); ++i) {
        const double d = std::abs(static_cast<double>(packets.data[i]) - rays.data[i]);
        apart += d <= 1e-4 ? 0 : 1;
      }
      // Near-ties of the order.
      CHECK(apart <= rays.data.size() / 200);
      CHECK(packets.data != rays.data);
      CHECK(by_packets.statistics().capped_rays > 0);
      if (!with_mesh) {
        CHECK(by_packets.statistics().capped_rays == by_rays.statistics().capped_rays);
      }
    }
  }
}

TEST_CASE("scenes have no near limit, over meshes and beside them, in packets and ray by ray") {
  Context context = make_test_context();
  Scene scene = cloud_scene(1);
  add_mesh(scene, rectangle({0, -2, 1.5}, {2, 0, 0}, {0, 4, 0}, 0), diffuse({0.7f, 0.2f, 0.4f}));
  for (const Traversal traversal : {Traversal::kAuto, Traversal::kBvh}) {
    CAPTURE(static_cast<int>(traversal));
    scene.trace.traversal = traversal;
    scene.trace.near_depth = 0.0f;
    PathTracer without(context, scene);
    scene.trace.near_depth = 4.0f;  // in the middle of the cloud
    PathTracer with(context, scene);
    CHECK(with.render(kCamera).data == without.render(kCamera).data);
    CHECK(with.first_hits(kCamera).depth.data == without.first_hits(kCamera).depth.data);
  }
}

TEST_CASE("lights on Gaussians shade what packets see as what rays one by one see [small]") {
  Context context = make_test_context();
  Scene scene = cloud_scene(1);
  scene.lights = {lamp()};
  scene.render.shadows.strength = 1.0f;
  scene.render.samples = 2;
  add_mesh(scene, rectangle({0.1, -1.0, 0}, {0.6, 0, 0.1}, {0, 0.1, 0.7}, 0),
           diffuse({0.7f, 0.2f, 0.4f}));
  for (const CameraModel model : {CameraModel::kPinhole, CameraModel::kFisheye}) {
    CAPTURE(static_cast<int>(model));
    Camera camera = cube_camera(45, 37);
    camera.model = model;
    const auto draw = [&](Traversal traversal, bool shadows) {
      scene.trace.traversal = traversal;
      scene.render.shadows.mesh_on_gaussians = shadows;
      return PathTracer(context, scene).render(camera);
    };
    const Image packets = draw(Traversal::kAuto, true), rays = draw(Traversal::kBvh, true);
    const Image unshaded = draw(Traversal::kBvh, false);
    std::size_t apart = 0, shaded = 0;
    for (std::size_t i = 0; i < rays.data.size(); ++i) {
      apart += std::abs(static_cast<double>(packets.data[i]) - rays.data[i]) <= 1e-4 ? 0 : 1;
      shaded += std::abs(static_cast<double>(unshaded.data[i]) - rays.data[i]) > 1e-2 ? 1 : 0;
    }
    // Near-ties of the order, and of the Gaussian whose depth is the median.
    CHECK(apart <= rays.data.size() / 200);
    CHECK(shaded > rays.data.size() / 20);
    CHECK(packets.data != rays.data);
  }
}

TEST_CASE("what a watch throws comes out, and nothing calls it afterwards [small]") {
  Context context = make_test_context();
  PathTracer tracer(context, cloud_scene(2));
  int calls = 0;
  {
    const auto owned = std::make_unique<int>(0);
    CHECK_THROWS_AS(tracer.render(kCamera,
                                  [&, number = owned.get()](double share) -> bool {
                                    *number = ++calls;
                                    if (share == 0.0) throw std::out_of_range("of the watch");
                                    return true;
                                  }),
                    std::out_of_range);
  }
  CHECK(calls == 1);
  const Image picture = tracer.render(kCamera);
  CHECK(calls == 1);
  CHECK(picture.data == PathTracer(context, cloud_scene(2)).render(kCamera).data);
}

TEST_CASE("threads that share a path tracer take turns") {
  Context context = make_test_context();
  Scene scene = cloud_scene(1);
  add_floor(scene);
  scene.lights = {lamp()};
  PathTracer tracer(context, scene);
  // Pictures of two sizes and kinds of camera, so that one's buffers and packets are not the
  // other's.
  std::array<Camera, 2> cameras{kCamera, cube_camera(15, 11)};
  cameras[1].model = CameraModel::kFisheye;
  std::array<Image, 2> expected;
  std::array<std::uint64_t, 2> rays{};
  for (std::size_t id = 0; id < 2; ++id) {
    expected[id] = tracer.render(cameras[id]);
    rays[id] = tracer.statistics().camera_rays;
  }
  REQUIRE(rays[0] != rays[1]);
  std::array<int, 2> wrong{};
  std::vector<std::thread> threads;
  for (std::size_t id = 0; id < 2; ++id) {
    threads.emplace_back([&, id] {
      for (int round = 0; round < 8; ++round) {
        // What two calls do together is held together by the context's lock.
        const auto turn = context.lock();
        wrong[id] += tracer.render(cameras[id]).data == expected[id].data ? 0 : 1;
        wrong[id] += tracer.statistics().camera_rays == rays[id] ? 0 : 1;
      }
      for (int round = 0; round < 8; ++round) {
        const bool watched = round % 2 == 0;
        std::function<bool(double)> watch;
        if (watched) watch = [](double) { return true; };
        wrong[id] += tracer.render(cameras[id], watch).data == expected[id].data ? 0 : 1;
      }
      // A picture that one thread gives up is nothing to the other.
      wrong[id] += tracer.render(cameras[id], [](double) { return false; }).data.empty() ? 0 : 1;
      wrong[id] += tracer.render(cameras[id]).data == expected[id].data ? 0 : 1;
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(wrong[0] == 0);
  CHECK(wrong[1] == 0);
}

TEST_CASE("environment pictures and textures") {
  Context context = make_test_context();
  Scene scene = cloud_scene();
  scene.environment.equirect = waves(64, 32);
  scene.environment.color = {1.0f, 0.8f, 1.2f};
  check_picture(context, scene, kCamera, "seen");
  scene.environment.up = {0.3f, -1.0f, 0.2f};
  scene.environment.rotation = 70.0f;
  check_picture(context, scene, kCamera, "turned");
  scene.environment.up = {0, 0, 1};
  check_picture(context, scene, kCamera, "up along z");
  scene.environment.up = {0, -1, 0};
  add_mesh(scene, ball({0.3, 0.1, 0}, 0.7, 8, 0, true), diffuse({0.7f, 0.9f, 0.4f}));
  check_picture(context, scene, kCamera, "lights a ball", kLitByPicture);
  add_mesh(scene, ball({-0.7, 0.1, 0}, 0.4, 8, 0, true), white(Material::Kind::kMirror));
  check_picture(context, scene, kCamera, "in a mirror", kLitByPicture);

  Material painted = white(Material::Kind::kDiffuse);
  painted.texture = 1;
  scene.textures = {Image(1, 1, 3, 0.5f), waves(7, 5)};
  Mesh wall = rectangle({0, 0.3, -0.9}, {0.9, 0, 0}, {0.3, 0.4, 0}, 0);
  for (float& x : wall.uvs) x = 2.5f * x - 0.7f;  // repeats
  add_mesh(scene, wall, painted);
  check_picture(context, scene, kCamera, "a texture", kLitByPicture);
}

TEST_CASE("other cameras and sizes of picture") {
  Context context = make_test_context();
  Scene scene = cloud_scene(1);
  add_mesh(scene, ball({0.2, 0.1, 0}, 0.7, 8, 0, true), white(Material::Kind::kMirror));
  add_floor(scene);
  check_picture(context, scene, cube_camera(33, 7), "wide");
  check_picture(context, scene, cube_camera(1, 1), "one pixel");
  check_picture(context, scene, look_at({2, -1.5, 2}, {0, 0, 0}, {0, -1, 0}, 20, 16, 18.0),
                "from behind");
  check_picture(context, scene, look_at({0.9, 0.0, 0.2}, {-1, 0, 0}, {0, -1, 0}, 20, 16, 10.0),
                "amid the cloud");
}

TEST_CASE("a scene without meshes is what the packet tracer draws") {
  Context context = make_test_context();
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    Scene scene = cloud_scene(2);
    scene.trace.hit_order = order;
    scene.environment.color = {0.2f, 0.4f, 0.6f};
    TraceOptions options = scene.trace;
    options.background = scene.environment.color;
    const Camera camera = cube_camera(24, 20);
    const Image image = PathTracer(context, scene).render(camera);
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, scene.gaussians, ScaleActivation::kExp);
    CameraTracer packets(context, options);
    packets.update(gaussians);
    packets.forward(gaussians, camera);
    const Image expected = packets.download_image();
    double largest = 0, sum = 0;
    for (std::size_t i = 0; i < expected.data.size(); ++i) {
      largest = std::max(largest, std::abs(static_cast<double>(image.data[i] - expected.data[i])));
      sum += static_cast<double>(expected.data[i]);
    }
    CHECK(sum > 1.0);
    CHECK(largest < 1e-4);
  }
}

TEST_CASE("Gaussians that coincide blend in the order of their indices, however they are traced") {
  Context context = make_test_context();
  // Every Gaussian a second time, in other colours.
  Gaussians model = reference::random_scene(120, 61, 0);
  const std::size_t half = model.size();
  const auto twice = [](std::vector<float>& values) {
    const std::vector<float> once = values;
    values.insert(values.end(), once.begin(), once.end());
  };
  for (auto* values : {&model.means, &model.quaternions, &model.log_scales, &model.opacities})
    twice(*values);
  for (std::size_t i = 0; i < 3 * half; ++i) model.sh.push_back(i % 3 == 0 ? 1.5f : -1.5f);
  for (float& opacity : model.opacities) opacity = 1.0f;
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    TraceOptions options;
    options.hit_order = order;
    const reference::Render expected =
        reference::render(reference::Parameters(model), options, kCamera);
    const auto compare = [&](const Image& image, const char* how) {
      CAPTURE(how);
      std::size_t other = 0;
      for (std::size_t i = 0; i < expected.pixels(); ++i) {
        double worst = 0;
        for (std::size_t c = 0; c < 3; ++c) {
          worst = std::max(worst, std::abs(static_cast<double>(image.data[4 * i + c]) -
                                           expected.image[c * expected.pixels() + i]));
        }
        other += worst > 1e-3 ? 1 : 0;
      }
      MESSAGE(std::string(how), ": ", other, " of ", expected.pixels());
      CHECK(other * 100 <= expected.pixels());
    };
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, model, ScaleActivation::kExp);
    for (const Traversal traversal : {Traversal::kTiles, Traversal::kBvh}) {
      options.traversal = traversal;
      ViewTracer tracer(context, options);
      tracer.forward(gaussians, kCamera);
      compare(tracer.download_image(), traversal == Traversal::kTiles ? "tiles" : "bvh");
    }
    Scene scene;
    scene.gaussians = model;
    scene.trace = options;
    compare(render_on_device(context, scene, kCamera), "paths");
  }
}

TEST_CASE("launches of light keep to a budget of time and give the same picture") {
  ContextOptions watched;
  watched.profile = watched.keep_launches = true;
  Context context(test_device(), watched);
  Scene scene = cloud_scene(1);
  add_mesh(scene, ball({0.2, 0.1, 0}, 0.7, 8, 0, true), white(Material::Kind::kMirror));
  add_floor(scene);
  scene.lights = {lamp()};
  const Camera camera = cube_camera(80, 60);
  const auto launches_of = [](const char* kernel, const std::vector<LaunchTime>& launches) {
    return std::count_if(launches.begin(), launches.end(),
                         [&](const LaunchTime& launch) { return launch.kernel == kernel; });
  };
  scene.trace.launch_budget_ms = 0;
  const Image whole = PathTracer(context, scene).render(camera);
  const std::vector<LaunchTime> few = context.take_launches();
  scene.trace.launch_budget_ms = 1e-6;
  const Image parts = PathTracer(context, scene).render(camera);
  const std::vector<LaunchTime> many = context.take_launches();
  CHECK(parts.data == whole.data);
  for (const char* kernel : {"trace_rays", "nearest_surface", "light_through"}) {
    CAPTURE(kernel);
    CHECK(launches_of(kernel, few) > 0);
    CHECK(launches_of(kernel, many) > 5 * launches_of(kernel, few));
  }
}

TEST_CASE("a world of any size looks the same") {
  Context context = make_test_context();
  const auto picture = [&](double size) {
    Scene scene;
    scene.environment.color = {0.3f, 0.4f, 0.5f};
    scene.environment.up = {0, -1, 0};
    Mesh body = ball({0.2, 0.1, 0}, 0.6, 10, 0, true);
    Mesh ground = rectangle({0, 0.7, 0}, {3, 0, 0}, {0, 0.1, 3}, 0);
    for (Mesh* mesh : {&body, &ground}) {
      for (float& x : mesh->positions) x = static_cast<float>(size * x);
    }
    add_mesh(scene, body, white(Material::Kind::kMirror));
    add_mesh(scene, ground, diffuse({0.8f, 0.7f, 0.5f}));
    Light lamp;
    lamp.kind = Light::Kind::kDirectional;
    lamp.direction = {0.5f, 1.0f, 0.3f};
    scene.lights = {lamp};
    return render_on_device(
        context, scene, look_at(size * glm::dvec3(0, -1, -4), {0, 0, 0}, {0, -1, 0}, 60, 60, 60.0));
  };
  const Image expected = picture(1.0);
  for (const double size : {1e-6, 1e-3, 1e5}) {
    CAPTURE(size);
    const Image image = picture(size);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < image.data.size(); ++i) {
      wrong += std::abs(image.data[i] - expected.data[i]) > 1e-3f ? 1 : 0;
    }
    CHECK(wrong * 200 < image.data.size());
  }
}
