// SPDX-License-Identifier: Apache-2.0
#include "raysplats/tracer.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <thread>

#include "raysplats/error.hpp"
#include "scene/camera/camera_model.hpp"
#include "unit/light/ray_result_gradient.hpp"
#include "unit/text.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;
using test::message_of;

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

glm::dvec3 vec(const float (&v)[3]) { return {v[0], v[1], v[2]}; }

double loss_of(const reference::RayTrace& trace, const RayResultGradient& g) {
  double loss = static_cast<double>(g.alpha) * trace.alpha;
  for (int c = 0; c < 3; ++c) loss += static_cast<double>(g.color[c]) * trace.color[c];
  return loss;
}

bool same_hits(const reference::RayTrace& a, const reference::RayTrace& b) {
  if (a.hits.size() != b.hits.size()) return false;
  for (std::size_t i = 0; i < a.hits.size(); ++i) {
    if (a.hits[i].index != b.hits[i].index) return false;
  }
  return true;
}

}  // namespace

TEST_CASE("gradients of rays equal central differences of a double reference [small]") {
  Context context = make_test_context();
  for (const int degree : {0, 2}) {
    const Gaussians gaussians = reference::random_scene(60, 31, degree);
    const reference::Parameters parameters(gaussians);
    const Model model(context, gaussians);
    for (const ColorDirection direction : {ColorDirection::kRay, ColorDirection::kFromOrigin}) {
      CAPTURE(degree);
      CAPTURE(static_cast<int>(direction));
      TraceOptions options;
      options.hit_order = HitOrder::kPeak;
      options.background = {0.3f, 0.2f, 0.4f};
      const auto mode = direction == ColorDirection::kRay ? reference::ColorMode::kAlongRay
                                                          : reference::ColorMode::kFromOrigin;
      const auto prepared = reference::prepare(parameters, options);
      const auto trace = [&](const glm::dvec3& o, const glm::dvec3& d, const Ray& ray) {
        return reference::trace_ray(parameters, prepared, options, o, d,
                                    static_cast<double>(ray.t_min), static_cast<double>(ray.t_max),
                                    mode);
      };
      const std::vector<Ray> rays = random_rays(150, 32, 2.0, 0.5, kInfinity);
      CounterRng rng(33, 1);
      std::vector<RayResultGradient> gradients(rays.size());
      for (RayResultGradient& g : gradients) g = random_gradient(rng);
      Tracer tracer(context, options);
      const std::vector<RayResult> results = tracer.trace(model, rays, direction, true);
      const RaysGradients got = tracer.backward(model, gradients);
      REQUIRE(got.rays.size() == rays.size());
      std::vector<float> device;
      std::vector<double> expected;
      const double step = 1e-6;
      for (std::size_t i = 0; i < rays.size(); ++i) {
        const glm::dvec3 o = vec(rays[i].origin), d = vec(rays[i].direction);
        const reference::RayTrace at = trace(o, d, rays[i]);
        if (at.margin < 1e-3) continue;
        CHECK(results[i].alpha == doctest::Approx(at.alpha).epsilon(1e-3));
        CHECK(results[i].hits == at.hits.size());
        for (int k = 0; k < 6; ++k) {
          glm::dvec3 shift(0.0);
          shift[k % 3] = step;
          const bool origin = k < 3;
          const reference::RayTrace above =
              trace(origin ? o + shift : o, origin ? d : d + shift, rays[i]);
          const reference::RayTrace below =
              trace(origin ? o - shift : o, origin ? d : d - shift, rays[i]);
          REQUIRE(same_hits(above, at));
          REQUIRE(same_hits(below, at));
          expected.push_back((loss_of(above, gradients[i]) - loss_of(below, gradients[i])) /
                             (2.0 * step));
          const RayGradient& by_ray = got.rays[i];
          device.push_back(origin ? by_ray.origin[k] : by_ray.direction[k - 3]);
        }
      }
      CHECK(expected.size() > 300);
      CHECK(relative_error(device, expected) < 1e-3);

      // In batches, which are traced again.
      TraceOptions tight = options;
      tight.memory_budget = 1000;
      Tracer batches(context, tight);
      std::vector<Ray> many;
      std::vector<RayResultGradient> of_many;
      while (many.size() < 5000) {
        many.insert(many.end(), rays.begin(), rays.end());
        of_many.insert(of_many.end(), gradients.begin(), gradients.end());
      }
      batches.trace(model, many, direction, true);
      const RaysGradients parts = batches.backward(model, of_many);
      for (std::size_t i = 0; i < many.size(); ++i) {
        for (int k = 0; k < 3; ++k) {
          REQUIRE(parts.rays[i].origin[k] == got.rays[i % rays.size()].origin[k]);
          REQUIRE(parts.rays[i].direction[k] == got.rays[i % rays.size()].direction[k]);
        }
      }
      const auto times = static_cast<float>(many.size() / rays.size());
      std::vector<double> scaled;
      for (const float value : got.parameters.means) scaled.push_back(times * value);
      CHECK(relative_error(parts.parameters.means, scaled) < 1e-4);
    }
  }
}

TEST_CASE("gradients of poses equal central differences for cameras of every model [small]") {
  Context context = make_test_context();
  const Gaussians gaussians = reference::random_scene(50, 35, 1);
  const reference::Parameters parameters(gaussians);
  const Model model(context, gaussians);
  TraceOptions options;
  options.hit_order = HitOrder::kPeak;
  const auto prepared = reference::prepare(parameters, options);
  for (const CameraModel lens : {CameraModel::kPinhole, CameraModel::kOpenCv, CameraModel::kFisheye,
                                 CameraModel::kEquirectangular, CameraModel::kOrthographic}) {
    CAPTURE(static_cast<int>(lens));
    Camera camera = look_at({0.5, -0.4, -3.0}, {0, 0, 0}, {0, -1, 0}, 20, 16, 20);
    camera.model = lens;
    if (lens == CameraModel::kOpenCv) camera.distortion = {-0.1, 0.02, 0, 0.002, -0.003, 0};
    if (lens == CameraModel::kOrthographic) camera.fx = camera.fy = 7;
    const auto mode = lens == CameraModel::kOrthographic ? reference::ColorMode::kAlongRay
                                                         : reference::ColorMode::kFromOrigin;
    const auto trace = [&](const Camera& view, std::size_t pixel) {
      const auto width = static_cast<std::size_t>(view.width);
      const CameraRay ray = camera_ray(view, static_cast<double>(pixel % width) + 0.5,
                                       static_cast<double>(pixel / width) + 0.5);
      return reference::trace_ray(parameters, prepared, options, ray.origin, ray.direction, 0.0,
                                  ray.valid ? 1e30 : -1.0, mode);
    };
    CounterRng rng(36, 1);
    Image gradient(camera.width, camera.height, 4);
    std::vector<RayResultGradient> of_pixels(gradient.pixels());
    std::vector<reference::RayTrace> at;
    for (std::size_t i = 0; i < gradient.pixels(); ++i) {
      at.push_back(trace(camera, i));
      of_pixels[i] = random_gradient(rng);
      if (at[i].margin < 1e-3) of_pixels[i] = {};
      for (std::size_t c = 0; c < 3; ++c) gradient.data[4 * i + c] = of_pixels[i].color[c];
      gradient.data[4 * i + 3] = of_pixels[i].alpha;
    }
    Tracer tracer(context, options);
    tracer.render(model, camera, true);
    const PoseGradient pose = tracer.backward(model, gradient).pose;

    const double step = 1e-6;
    const auto difference = [&](const Camera& above, const Camera& below) {
      double sum = 0;
      for (std::size_t i = 0; i < of_pixels.size(); ++i) {
        if (at[i].margin < 1e-3) continue;
        const reference::RayTrace a = trace(above, i), b = trace(below, i);
        REQUIRE(same_hits(a, at[i]));
        REQUIRE(same_hits(b, at[i]));
        sum += (loss_of(a, of_pixels[i]) - loss_of(b, of_pixels[i])) / (2.0 * step);
      }
      return sum;
    };
    std::vector<float> device;
    std::vector<double> expected;
    for (int k = 0; k < 6; ++k) {
      const auto moved = [&](double by) {
        Camera view = camera;
        glm::dvec3 axis(0.0);
        axis[k % 3] = by;
        if (k < 3) {
          view.translation = -(view.rotation * (camera.center() + axis));
        } else {
          // exp([w]x) to first order, and its error cancels in the central difference.
          const glm::dmat3 turn(1.0, axis.z, -axis.y, -axis.z, 1.0, axis.x, axis.y, -axis.x, 1.0);
          view.rotation = turn * camera.rotation;
          view.translation = -(view.rotation * camera.center());
        }
        return view;
      };
      expected.push_back(difference(moved(step), moved(-step)));
      const auto axis = static_cast<std::size_t>(k % 3);
      device.push_back(static_cast<float>(k < 3 ? pose.center[axis] : pose.rotation[axis]));
    }
    CHECK(relative_error({device.begin(), device.begin() + 3},
                         {expected.begin(), expected.begin() + 3}) < 2e-3);
    CHECK(relative_error({device.begin() + 3, device.end()},
                         {expected.begin() + 3, expected.end()}) < 2e-3);
  }
}

TEST_CASE("a tracer follows its model, and refuses gradients of a state that is gone") {
  Context context = make_test_context();
  Gaussians gaussians = reference::random_scene(200, 37, 0);
  Model model(context, gaussians);
  Tracer tracer(context);
  const Camera camera = reference::cube_camera(24, 20);
  const std::vector<Ray> rays = random_rays(50, 38, 2.0, 0.5, kInfinity);
  const Image before = tracer.render(model, camera, true);
  tracer.trace(model, rays, ColorDirection::kRay, true);
  const std::uint64_t revision = model.revision();
  for (float& x : gaussians.means) x += 0.1f;
  model.assign(gaussians);
  CHECK(model.revision() != revision);
  CHECK(model.download().means == gaussians.means);
  const std::vector<RayResultGradient> gradients(rays.size());
  CHECK_THROWS_AS(tracer.backward(model, Image(24, 20, 4)), UsageError);
  CHECK_THROWS_AS(tracer.backward(model, gradients), UsageError);
  // The trees are those of the new parameters.
  const Image after = tracer.render(model, camera);
  const Model fresh(context, gaussians);
  Tracer other(context);
  CHECK(after.data != before.data);
  CHECK(after.data == other.render(fresh, camera).data);
  const std::vector<RayResult> a = tracer.trace(model, rays), b = other.trace(fresh, rays);
  for (std::size_t i = 0; i < rays.size(); ++i) CHECK(a[i].color[0] == b[i].color[0]);
  // Another model of the same size is not the one that was traced.
  tracer.render(model, camera, true);
  CHECK_THROWS_AS(tracer.backward(fresh, Image(24, 20, 4)), UsageError);
  CHECK_NOTHROW(tracer.backward(model, Image(24, 20, 4)));
}

TEST_CASE("a tracer with a mirror sees, and differentiates, what a camera behind it would see") {
  Context context = make_test_context();
  // Gaussians behind the camera, and a mirror before it that fills the picture.
  Gaussians gaussians = reference::random_scene(60, 41, 0);
  for (std::size_t i = 0; i < gaussians.size(); ++i) gaussians.means[3 * i + 2] -= 4.0f;
  const Model model(context, gaussians);
  Mesh wall;
  wall.positions = {-9, -9, 3, 9, -9, 3, 9, 9, 3, -9, 9, 3};
  wall.triangles = {0, 1, 2, 0, 2, 3};
  wall.materials = {0, 0};
  Mirrors mirrors;
  mirrors.meshes = {wall};
  mirrors.materials.resize(1);
  mirrors.materials[0].kind = Material::Kind::kMirror;
  mirrors.materials[0].color = {1.0f, 1.0f, 1.0f};
  Tracer tracer(context, {}, mirrors);
  Tracer direct(context);
  const Camera camera = look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 32, 24, 40.0);
  const Camera image_of_it = look_at({0, 0, 6}, {0, 0, 0}, {0, -1, 0}, 32, 24, 40.0);

  const Image seen = tracer.render(model, camera, true);
  const Image expected = direct.render(model, image_of_it, true);
  Image gradient(32, 24, 4), flipped(32, 24, 4);
  CounterRng rng(42, 6);
  double worst = 0.0, covered = 0.0;
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) {
      for (int c = 0; c < 4; ++c) {
        worst = std::max<double>(worst, std::abs(seen.at(x, y, c) - expected.at(31 - x, y, c)));
        gradient.at(x, y, c) = flipped.at(31 - x, y, c) = static_cast<float>(rng.normal());
      }
      covered += static_cast<double>(expected.at(x, y, 3));
    }
  }
  CHECK(worst < 1e-4);
  CHECK(covered > 50.0);

  const ViewGradients got = tracer.backward(model, gradient);
  const ViewGradients wanted = direct.backward(model, flipped);
  CHECK(std::isnan(got.pose.center[0]));
  CHECK(std::isfinite(wanted.pose.center[0]));
  double off = 0.0, size = 0.0;
  for (std::size_t i = 0; i < got.parameters.means.size(); ++i) {
    off += std::pow(got.parameters.means[i] - wanted.parameters.means[i], 2);
    size += std::pow(wanted.parameters.means[i], 2);
  }
  CHECK(size > 0.0);
  CHECK(std::sqrt(off / size) < 1e-3);

  const std::vector<Ray> ray{{{0, 0, 0}, 0, {0, 0, 1}, kInfinity}};
  CHECK(message_of<UsageError>([&] { tracer.trace(model, ray); }).find("mirrors") !=
        std::string::npos);
}

TEST_CASE("models and tracers refuse what cannot be traced") {
  Context context = make_test_context();
  Gaussians gaussians = reference::random_scene(20, 39, 1);
  Model model(context, gaussians);
  Tracer tracer(context);

  Gaussians wrong = gaussians;
  wrong.quaternions.pop_back();
  CHECK(message_of<UsageError>([&] { Model(context, wrong); }).find("quaternions") !=
        std::string::npos);
  wrong = gaussians;
  wrong.sh_degree = 2;
  CHECK(message_of<UsageError>([&] { model.assign(wrong); }).find("sh") != std::string::npos);
  wrong.sh_degree = 5;
  CHECK_THROWS_AS(Model(context, wrong), UsageError);
  wrong = gaussians;
  wrong.log_scales[7] = kNan;
  CHECK_THROWS_AS(Model(context, wrong), DataError);
  CHECK(model.download().log_scales == gaussians.log_scales);

  const Ray good{{0, 0, -3}, 0, {0, 0, 1}, kInfinity};
  const auto refused = [&](const Ray& bad) {
    const std::vector<Ray> rays{good, bad};
    return message_of<UsageError>([&] { tracer.trace(model, rays); });
  };
  CHECK(refused(good).empty());
  Ray bad = good;
  bad.origin[1] = kNan;
  CHECK(refused(bad).find("Ray 1 ") != std::string::npos);
  CHECK(refused(bad).find("not finite") != std::string::npos);
  bad = good;
  bad.direction[2] = 0;
  CHECK(refused(bad).find("length 0") != std::string::npos);
  bad.direction[0] = kInfinity;
  CHECK(refused(bad).find("not finite") != std::string::npos);
  bad.direction[0] = 2e19f;
  CHECK(refused(bad).find("beyond 1e19") != std::string::npos);
  bad.direction[0] = 9e18f;
  CHECK(refused(bad).empty());
  bad = good;
  bad.origin[1] = -2e19f;
  CHECK(refused(bad).find("an origin farther than 1e19 from 0") != std::string::npos);
  bad.origin[1] = -9e18f;
  CHECK(refused(bad).empty());
  bad = good;
  bad.t_min = 2;
  bad.t_max = 1;
  CHECK(refused(bad).find("ends before it begins") != std::string::npos);
  bad.t_max = kNan;
  CHECK(refused(bad).find("not finite") != std::string::npos);
  bad = good;
  bad.t_min = -1;
  CHECK(refused(bad).find("before its origin") != std::string::npos);
  CHECK(tracer.trace(model, {}).empty());

  const std::vector<Ray> rays{good, good};
  std::vector<RayResultGradient> gradients(2);
  CHECK_THROWS_AS(tracer.backward(model, gradients), UsageError);
  tracer.trace(model, rays);
  CHECK_THROWS_AS(tracer.backward(model, gradients), UsageError);
  tracer.trace(model, rays, ColorDirection::kRay, true);
  gradients.resize(3);
  CHECK_THROWS_AS(tracer.backward(model, gradients), UsageError);
  gradients.resize(2);
  gradients[1].alpha = kNan;
  CHECK_THROWS_AS(tracer.backward(model, gradients), UsageError);
  gradients[1].alpha = 0;
  CHECK_NOTHROW(tracer.backward(model, gradients));

  Camera camera = reference::cube_camera(8, 6);
  CHECK_THROWS_AS(tracer.depth(), UsageError);
  const auto refused_gradient = [&](const Image& gradient) {
    return message_of<UsageError>([&] { tracer.backward(model, gradient); });
  };
  CHECK(refused_gradient(Image(8, 6, 4)).find("There is no picture yet") != std::string::npos);
  tracer.render(model, camera);
  CHECK_THROWS_AS(tracer.depth(), UsageError);
  CHECK(refused_gradient(Image(8, 6, 4))
            .find("Tracer::backward() must follow render(differentiable = true)") == 0);
  tracer.render(model, camera, true);
  Image brief(8, 6, 4);
  brief.data.pop_back();
  CHECK(refused_gradient(brief).find("has 191 numbers: give 192") != std::string::npos);
  CHECK_THROWS_AS(tracer.backward(model, Image(8, 6, 3)), UsageError);
  CHECK_THROWS_AS(tracer.backward(model, Image(6, 8, 4)), UsageError);
  CHECK_THROWS_AS(tracer.backward(model, Image(8, 6, 4, kNan)), UsageError);
  CHECK_NOTHROW(tracer.backward(model, Image(8, 6, 4)));
  for (const CameraModel lens : {CameraModel::kPinhole, CameraModel::kFisheye}) {
    Camera broken = camera;
    broken.model = lens;
    broken.translation.y = static_cast<double>(kNan);
    CHECK(message_of<UsageError>([&] { tracer.render(model, broken); }).find("not finite") !=
          std::string::npos);
    broken = camera;
    broken.model = lens;
    broken.width = 0;
    CHECK_THROWS_AS(tracer.render(model, broken), UsageError);
    for (const glm::dvec3& factors : {glm::dvec3(2, 1, 1), glm::dvec3(1.002), glm::dvec3(-1)}) {
      broken = camera;
      broken.model = lens;
      for (int k = 0; k < 3; ++k) broken.rotation[k] *= factors[k];
      CHECK(message_of<UsageError>([&] {
              tracer.render(model, broken);
            }).find("scales, shears or mirrors") != std::string::npos);
      CHECK_THROWS_AS(tracer.normals(model, broken), UsageError);
    }
    // What single precision and a step along a tangent leave of a rotation.
    broken = camera;
    broken.model = lens;
    broken.rotation[0] *= 1.0004;
    CHECK_NOTHROW(tracer.render(model, broken));
  }

  for (const float value : {kNan, kInfinity}) {
    CHECK(message_of<UsageError>([&] {
            tracer.set_background({0, value, 0});
          }).find("not finite") != std::string::npos);
    TraceOptions behind;
    behind.background[2] = value;
    CHECK_THROWS_AS(Tracer(context, behind), UsageError);
  }
  CHECK(tracer.options().background == std::array<float, 3>{});

  Context second = make_test_context();
  const Model elsewhere(second, gaussians);
  CHECK(message_of<UsageError>([&] { tracer.render(elsewhere, camera); }).find("another context") !=
        std::string::npos);
  CHECK_THROWS_AS(tracer.trace(elsewhere, rays), UsageError);

  TraceOptions options;
  options.near_depth = 0.5f;
  Tracer near(context, options);
  CHECK_NOTHROW(near.render(model, camera));
  CHECK_THROWS_AS(near.trace(model, rays), UsageError);
  options.near_depth = 0;
  options.quantile = kNan;
  CHECK_THROWS_AS(Tracer(context, options), UsageError);
}

TEST_CASE("threads that share a context take turns") {
  Context context = make_test_context();
  const Model model(context, reference::random_scene(300, 40, 1));
  const Camera camera = reference::cube_camera(32, 24);
  const std::vector<Ray> rays = random_rays(64, 41, 2.0, 0.5, kInfinity);
  Tracer tracer(context);
  const Image expected = tracer.render(model, camera);
  const std::vector<RayResult> results = tracer.trace(model, rays);
  std::vector<std::thread> threads;
  std::array<int, 2> wrong{};
  for (std::size_t id = 0; id < 2; ++id) {
    threads.emplace_back([&, id] {
      Tracer own(context);
      for (int round = 0; round < 10; ++round) {
        wrong[id] += own.render(model, camera).data == expected.data ? 0 : 1;
        // The shared one too.
        const std::vector<RayResult> got = tracer.trace(model, rays);
        for (std::size_t i = 0; i < rays.size(); ++i) {
          wrong[id] += got[i].alpha == results[i].alpha ? 0 : 1;
        }
        const Model mine(context, reference::random_scene(40, 42 + id, 0));
        wrong[id] += own.render(mine, camera).data == expected.data ? 1 : 0;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(wrong[0] == 0);
  CHECK(wrong[1] == 0);
}
