// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <array>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <string>

#include "raysplats/error.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/image/pixel_count.hpp"
#include "trace/camera_rays.hpp"
#include "trace/lens_tiles.hpp"
#include "trace/ray_backward.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

// Packets of a width, from 32 on as work-groups, on tiles small enough for small pictures.
struct LensContext {
  LensContext(int width, int tile) {
    DeviceTuning tuning;
    tuning.grouped = width >= 32;
    tuning.packet_width = width;
    tuning.tile = tile;
    tuning.pending = width == 1 ? 7 : 48;
    context.set_tuning(tuning);
  }
  Context context = make_test_context();
};

struct View {
  std::string name;
  Camera camera;
  std::size_t faces;
};

Camera lens_camera_at(CameraModel model, int width, int height, double focal, double distance) {
  Camera camera = look_at({0.4, -0.3, -distance}, {0, 0, 0}, {0.1, -1, 0}, width, height, focal);
  camera.model = model;
  return camera;
}

std::vector<View> views() {
  std::vector<View> out;
  Camera opencv = lens_camera_at(CameraModel::kOpenCv, 37, 29, 24, 2.6);
  opencv.distortion = {-0.12, 0.02, 0.0, 0.003, -0.002, 0.0};
  out.push_back({"opencv", opencv, 1});
  Camera narrow = lens_camera_at(CameraModel::kFisheye, 38, 33, 22, 2.4);
  narrow.distortion.k1 = -0.03;
  narrow.distortion.k2 = 0.004;
  out.push_back({"fisheye", narrow, 1});
  // More than half of everything, from within; the corners see nothing.
  Camera wide = lens_camera_at(CameraModel::kFisheye, 48, 48, 10.5, 0.3);
  wide.distortion.k1 = 0.02;
  wide.distortion.k2 = -0.006;
  out.push_back({"wide fisheye", wide, 6});
  out.push_back({"panorama", lens_camera_at(CameraModel::kEquirectangular, 80, 40, 1, 0.2), 6});
  return out;
}

// What double precision says of every pixel.
struct Expected {
  std::vector<reference::RayQuery> queries;
  std::vector<reference::RayTrace> rays;
  std::vector<double> depth;  // as packets count it
};

Expected expected_of(const reference::Parameters& parameters,
                     const TraceOptions& options,
                     const Camera& camera) {
  Expected out;
  const glm::dvec3 axis = glm::transpose(camera.rotation) * glm::dvec3(0, 0, 1);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const CameraRay ray = camera_ray(camera, x + 0.5, y + 0.5);
      out.queries.push_back({ray.origin, ray.direction, 0.0, ray.valid ? 1e30 : -1.0});
      out.rays.push_back(reference::trace_ray(parameters, options, ray.origin, ray.direction, 0.0,
                                              out.queries.back().t_max,
                                              reference::ColorMode::kFromOrigin));
      const double along =
          camera.model == CameraModel::kOpenCv ? glm::dot(axis, ray.direction) : 1.0;
      out.depth.push_back(along * out.rays.back().expected_depth);
    }
  }
  return out;
}

void check_picture(const Image& image, const Image& depth, const Expected& expected) {
  std::size_t compared = 0, hit = 0, wrong = 0;
  double sum = 0;
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const reference::RayTrace& ray = expected.rays[i];
    if (ray.margin < 1e-4) continue;
    ++compared;
    hit += ray.hits.empty() ? 0 : 1;
    double worst = std::abs(static_cast<double>(image.data[4 * i + 3]) - ray.alpha);
    for (int c = 0; c < 3; ++c) {
      const double value = image.data[4 * i + static_cast<std::size_t>(c)];
      worst = std::max(worst, std::abs(value - ray.color[c]));
    }
    sum += worst;
    const double far = expected.depth[i];
    const bool depth_wrong =
        std::abs(static_cast<double>(depth.data[3 * i]) - far) > 2e-3 * (1 + far) ||
        depth.data[3 * i + 2] != static_cast<float>(ray.hits.size());
    wrong += worst > 2e-3 || depth_wrong ? 1 : 0;
  }
  CHECK(wrong == 0);
  CHECK(sum / static_cast<double>(compared) < 2e-5);
  CHECK(2 * compared > image.pixels());
  CHECK(3 * hit > image.pixels());
}

std::vector<float> gradient_without_ties(const Expected& expected) {
  const std::size_t pixels = expected.rays.size();
  std::vector<float> gradient = random_image_gradient(pixels, 7);
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 4 && expected.rays[i].margin < 1e-4; ++c)
      gradient[c * pixels + i] = 0.0f;
  }
  return gradient;
}

reference::Parameters expected_gradient(const reference::Parameters& parameters,
                                        const TraceOptions& options,
                                        const Expected& expected,
                                        const std::vector<float>& gradient) {
  const std::size_t pixels = expected.rays.size();
  std::vector<double> by_ray;
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 4; ++c) by_ray.push_back(gradient[c * pixels + i]);
  }
  return reference::ray_gradient(parameters, options, expected.queries, by_ray,
                                 reference::ColorMode::kFromOrigin);
}

void check_view(Context& context, const View& view, const Gaussians& model, TraceOptions options) {
  CAPTURE(view.name);
  options.background = {0.1f, 0.3f, 0.5f};
  options.depth = true;
  const reference::Parameters parameters(model);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const Expected expected = expected_of(parameters, options, view.camera);
  CameraTracer tracer(context, options);
  REQUIRE(tracer.traces(view.camera));
  tracer.update(gaussians);
  tracer.forward(gaussians, view.camera, true);
  check_picture(tracer.download_image(), tracer.download_depth(), expected);
  const std::vector<float> gradient = gradient_without_ties(expected);
  CHECK_ERRORS(errors_of(backward(context, tracer, gaussians, gradient),
                         expected_gradient(parameters, options, expected, gradient)),
               1e-3);
}

}  // namespace

TEST_CASE("packets through every lens equal the double reference, forward and backward") {
  const Gaussians model = reference::random_scene(400, 42, 2);
  for (const int width : {1, 4, 16, 32}) {
    LensContext context_holder(width, 8);
    Context& context = context_holder.context;
    CAPTURE(width);
    for (const View& view : views()) {
      TraceOptions options;
      options.hit_order = width == 4 ? HitOrder::kEntry : HitOrder::kPeak;
      check_view(context, view, model, options);
    }
  }
}

TEST_CASE("packets through a lens with an adaptive radius and degree 0, atomically [small]") {
  LensContext context_holder(4, 8);
  Context& context = context_holder.context;
  TraceOptions options;
  options.adaptive_radius = true;
  options.gradient_sum = GradientSum::kAtomic;
  for (const View& view : views())
    check_view(context, view, reference::random_scene(60, 43, 0), options);
}

TEST_CASE("packets through a lens in little memory are traced band by band") {
  LensContext context_holder(4, 8);
  Context& context = context_holder.context;
  const Gaussians model = reference::random_scene(400, 44, 1);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  for (const View& view : views()) {
    CAPTURE(view.name);
    for (const GradientSum sum : {GradientSum::kAuto, GradientSum::kExact}) {
      CAPTURE(static_cast<int>(sum));
      TraceOptions options;
      options.gradient_sum = sum;
      CameraTracer roomy(context, options);
      options.memory_budget = 256 << 10;
      CameraTracer tight(context, options);
      roomy.update(gaussians);
      tight.update(gaussians);
      roomy.forward(gaussians, view.camera, true);
      tight.forward(gaussians, view.camera, true);
      CHECK(roomy.download_image().data == tight.download_image().data);
      CHECK(tight.statistics().hits == roomy.statistics().hits);
      const std::size_t pixels = roomy.download_image().pixels();
      const std::vector<float> gradient = random_image_gradient(pixels, 3);
      const HostGradients a = backward(context, roomy, gaussians, gradient);
      const HostGradients b = backward(context, tight, gaussians, gradient);
      if (sum == GradientSum::kExact) {
        CHECK(a == b);
        continue;
      }
      const auto wide = [](const std::vector<float>& v) {
        return std::vector<double>(v.begin(), v.end());
      };
      // Sums in the order in which work-groups come vary by 1.1e-4 in the same tracer.
      const bool ordered = context.device().type == DeviceType::kCpu;
      CHECK(relative_error(b.means, wide(a.means)) < (ordered ? 1e-4 : 1e-3));
      CHECK(relative_error(b.sh, wide(a.sh)) < 1e-4);
    }
  }
}

TEST_CASE("the near plane of a lens counts depth, or distance where it looks around") {
  LensContext context_holder(4, 8);
  Context& context = context_holder.context;
  const Gaussians model = reference::random_scene(200, 45, 1);
  for (const View& view : views()) {
    CAPTURE(view.name);
    TraceOptions options;
    options.near_depth = view.faces == 1 ? 2.3f : 0.6f;
    const glm::dvec3 axis = glm::transpose(view.camera.rotation) * glm::dvec3(0, 0, 1);
    std::size_t kept = 0;
    Gaussians far = model;
    for (std::size_t i = 0; i < model.size(); ++i) {
      const glm::dvec3 offset =
          glm::dvec3(model.means[3 * i], model.means[3 * i + 1], model.means[3 * i + 2]) -
          view.camera.center();
      const double depth =
          view.camera.model == CameraModel::kOpenCv ? glm::dot(axis, offset) : glm::length(offset);
      if (depth >= static_cast<double>(options.near_depth)) {
        ++kept;
      } else {
        far.opacities[i] = -40.0f;
      }
    }
    REQUIRE(kept > 20);
    REQUIRE(kept + 20 < model.size());
    const Expected expected = expected_of(reference::Parameters(far), options, view.camera);
    const Image image = trace_image(context, model, options, view.camera);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < image.pixels(); ++i) {
      if (expected.rays[i].margin < 1e-4) continue;
      wrong += std::abs(static_cast<double>(image.data[4 * i + 3]) - expected.rays[i].alpha) < 2e-3
                   ? 0
                   : 1;
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("the screen gradients of a lens are those of its rays one by one") {
  LensContext context_holder(4, 8);
  Context& context = context_holder.context;
  const Gaussians model = reference::random_scene(500, 46, 1);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  TraceOptions options;
  for (View view : views()) {
    CAPTURE(view.name);
    // From afar: where Gaussians are large against their distance the two differ by more.
    view.camera.translation += glm::dvec3(0, 0, 3);
    const Expected expected = expected_of(reference::Parameters(model), options, view.camera);
    const std::vector<float> gradient = gradient_without_ties(expected);
    const std::size_t pixels = expected.rays.size();
    CameraTracer tracer(context, options);
    tracer.update(gaussians);
    tracer.forward(gaussians, view.camera, true);
    const HostGradients packets = backward(context, tracer, gaussians, gradient);

    RayTracer ray_tracer(context, options);
    ray_tracer.update(gaussians);
    CameraRays generator(context);
    Buffer<Ray> rays;
    generator.generate(view.camera, Lens{}, 0, pixels, rays);
    Buffer<RayResult> results;
    ray_tracer.trace(gaussians, rays, pixels, results, ColorDirection::kFromOrigin);
    std::vector<RayBackward::ResultGradient> by_ray(pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
      for (std::size_t c = 0; c < 4; ++c) by_ray[i][c] = gradient[c * pixels + i];
    }
    Buffer<RayBackward::ResultGradient> uploaded(context, pixels, "ray gradients");
    uploaded.upload(by_ray);
    RayBackward ray_backward(context, ray_tracer);
    ray_backward.begin(gaussians, RayScreen::of(view.camera));
    ray_backward.add(gaussians, rays, pixels, results, uploaded, ColorDirection::kFromOrigin);
    GaussianGradients out;
    ray_backward.finish(gaussians, out);
    const HostGradients single(out);
    check_screen(packets, single, 0.08, 0.1);
  }
}

TEST_CASE("tiles of a lens are on the faces that see them, until the lens changes [small]") {
  LensContext context_holder(4, 8);
  Context& context = context_holder.context;
  LensTiles lens(context, 8);
  for (const View& view : views()) {
    CAPTURE(view.name);
    CHECK(lens.prepare(view.camera));
    CHECK(lens.faces().size() == view.faces);
    // Every pixel's tangent coordinates on the face of its tile are its ray.
    const std::vector<RsLensTile> tiles = lens.tiles().download();
    const std::vector<float> tangents = lens.tangents().download();
    const std::size_t pixels = pixel_count(view.camera);
    std::size_t wrong = 0, blind = 0;
    for (std::size_t i = 0; i < pixels; ++i) {
      const int x = static_cast<int>(i) % view.camera.width;
      const int y = static_cast<int>(i) / view.camera.width;
      const CameraRay ray = camera_ray(view.camera, x + 0.5, y + 0.5);
      if (!ray.valid) {
        ++blind;
        wrong += std::isnan(tangents[i]) ? 0 : 1;
        continue;
      }
      const int across = (view.camera.width + 7) / 8;
      const RsLensTile& tile = tiles[static_cast<std::size_t>(y / 8 * across + x / 8)];
      const glm::dvec3 d = LensTiles::rotation(tile.face) * view.camera.rotation * ray.direction;
      wrong += d.z > 0.14 && std::abs(d.x / d.z - static_cast<double>(tangents[i])) < 1e-4 &&
                       std::abs(d.y / d.z - static_cast<double>(tangents[pixels + i])) < 1e-4 &&
                       tangents[i] >= tile.x0 && tangents[i] <= tile.x1
                   ? 0
                   : 1;
    }
    CHECK(wrong == 0);
    CHECK((blind > 0) == (view.name == "wide fisheye"));
  }
  // A pose is no part of a lens.
  Camera camera = views()[2].camera;
  lens.prepare(camera);
  camera.translation += glm::dvec3(1, 2, 3);
  CHECK(lens.prepare(camera));
  // A tile that sees nearly everything.
  CHECK_FALSE(lens.prepare(lens_camera_at(CameraModel::kEquirectangular, 16, 8, 1, 0.2)));
}

TEST_CASE("cameras that packets cannot trace are refused in one sentence") {
  LensContext context_holder(4, 32);
  Context& context = context_holder.context;
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(context, reference::random_scene(20, 43, 0), ScaleActivation::kExp);
  CameraTracer tracer(context, {});
  tracer.update(gaussians);
  const Camera small = lens_camera_at(CameraModel::kEquirectangular, 40, 20, 1, 0.2);
  CHECK_FALSE(tracer.traces(small));
  CHECK_THROWS_AS(tracer.forward(gaussians, small), UsageError);
  const Camera flat = lens_camera_at(CameraModel::kOrthographic, 40, 20, 9, 2);
  CHECK_FALSE(tracer.traces(flat));
  CHECK_THROWS_AS(tracer.forward(gaussians, flat), UsageError);
}

TEST_CASE("the pose of every lens has the gradient of finite differences in double precision") {
  LensContext holder(4, 8);
  Context& context = holder.context;
  const Gaussians model = reference::random_scene(30, 47, 1);
  const reference::Parameters parameters(model);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  TraceOptions options;
  options.hit_order = HitOrder::kPeak;
  for (const View& view : views()) {
    CAPTURE(view.name);
    const Expected expected = expected_of(parameters, options, view.camera);
    std::vector<float> gradient = gradient_without_ties(expected);
    const std::size_t pixels = expected.rays.size();
    constexpr double kStep = 1e-5;
    // Turned or moved by `by` along coordinate k of the pose; hits must stay what they are.
    const auto moved = [&](int k, double by) {
      Camera camera = view.camera;
      const glm::dvec3 center = camera.center();
      glm::dvec3 step(0.0);
      step[k % 3] = by;
      if (k < 3) {
        camera.translation = -(camera.rotation * (center + step));
      } else {
        camera.rotation = glm::dmat3(glm::rotate(glm::dmat4(1.0), by, step / by)) * camera.rotation;
        camera.translation = -(camera.rotation * center);
      }
      return expected_of(parameters, options, camera);
    };
    std::vector<std::array<Expected, 2>> around;
    for (int k = 0; k < 6; ++k) around.push_back({moved(k, kStep), moved(k, -kStep)});
    for (std::size_t i = 0; i < pixels; ++i) {
      bool same = true;
      for (const auto& sides : around) {
        for (const Expected& side : sides) {
          same = same && side.rays[i].hits.size() == expected.rays[i].hits.size();
          for (std::size_t h = 0; same && h < side.rays[i].hits.size(); ++h)
            same = side.rays[i].hits[h].index == expected.rays[i].hits[h].index;
        }
      }
      for (std::size_t c = 0; c < 4 && !same; ++c) gradient[c * pixels + i] = 0.0f;
    }
    CameraTracer tracer(context, options);
    tracer.update(gaussians);
    tracer.forward(gaussians, view.camera, true);
    Buffer<float> uploaded(context, gradient.size(), "image gradient");
    uploaded.upload(gradient);
    GaussianGradients out;
    PoseGradient pose;
    tracer.backward(gaussians, uploaded, out, &pose);
    double length = 0;
    std::array<double, 6> numeric{};
    for (std::size_t k = 0; k < 6; ++k) {
      for (std::size_t i = 0; i < pixels; ++i) {
        const reference::RayTrace &above = around[k][0].rays[i], &below = around[k][1].rays[i];
        double change = gradient[3 * pixels + i] * (above.alpha - below.alpha);
        for (int c = 0; c < 3; ++c)
          change += gradient[static_cast<std::size_t>(c) * pixels + i] *
                    (above.color[c] - below.color[c]);
        numeric[k] += change / (2 * kStep);
      }
      length = std::max(length, std::abs(numeric[k]));
    }
    for (std::size_t k = 0; k < 3; ++k) {
      CHECK(std::abs(pose.center[k] - numeric[k]) < 2e-3 * length);
      CHECK(std::abs(pose.rotation[k] - numeric[k + 3]) < 2e-3 * length);
    }
  }
}
