// SPDX-License-Identifier: Apache-2.0
#include "render/frame_writer.hpp"

#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "render/previews.hpp"
#include "render/shutter.hpp"
#include "scene/image/pixel_count.hpp"
#include "trace/camera_tracer.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

std::vector<std::string> names_of(const std::vector<std::string>& images) {
  std::vector<Camera> cameras(images.size());
  for (std::size_t i = 0; i < images.size(); ++i) cameras[i].name = images[i];
  return frame_names(cameras);
}

/// Two opaque red Gaussians, at the origin and further away beside it.
Gaussians red_balls() {
  Gaussians model;
  model.resize(2);
  for (float& scale : model.log_scales) scale = std::log(0.3f);
  model.means = {0, 0, 0, 2, 0, 4};
  model.opacities = {8.0f, 8.0f};
  model.sh = {1.5f, -1.5f, -1.5f, 1.5f, -1.5f, -1.5f};
  return model;
}

/// Channel `name` of an EXR, row-major.
std::vector<float> exr_channel(const fs::path& path, const std::string& name) {
  const auto file = OIIO::ImageInput::open(path.string());
  REQUIRE(file);
  const OIIO::ImageSpec& spec = file->spec();
  const int channel = spec.channelindex(name);
  REQUIRE(channel >= 0);
  std::vector<float> values(pixel_count(spec.width, spec.height));
  REQUIRE(file->read_image(0, 0, channel, channel + 1, OIIO::TypeDesc::FLOAT, values.data()));
  return values;
}

}  // namespace

TEST_CASE("frames are named after the images") {
  CHECK(names_of({"train/r_0.png", "train/r_1.png"}) == std::vector<std::string>{"r_0", "r_1"});
  CHECK(names_of({"left/1.jpg", "right/1.jpg", "right/2.jpg"}) ==
        std::vector<std::string>{"left_1", "right_1", "2"});
  CHECK(names_of({"../../a/1.jpg", "/b/1.jpg"}) == std::vector<std::string>{"a_1", "b_1"});
  CHECK(names_of({"1.jpg", "1.png"}) == std::vector<std::string>{"1", "1_2"});
  CHECK(names_of({"", ""}) == std::vector<std::string>{"frame_0000", "frame_0001"});
}

TEST_CASE("frames of one name are numbered, around the names that others have") {
  CHECK(names_of({"a.png", "a_2.png", "a.png", "a.png", "a_2.png", "a_5.png", "a.png", "a.png"}) ==
        std::vector<std::string>{"a", "a_2", "a_3", "a_4", "a_2_2", "a_5", "a_6", "a_7"});
  // So many that trying all numbers again for each of them would take minutes.
  constexpr std::size_t kMany = 50000;
  const std::vector<std::string> names = names_of(std::vector<std::string>(kMany, "left/a.png"));
  REQUIRE(names.size() == kMany);
  CHECK(names.front() == "left_a");
  CHECK(names[1] == "left_a_2");
  CHECK(names.back() == "left_a_50000");
}

TEST_CASE("depth, hits and capped rays of a blurred frame are those of all its moments") {
  const TemporaryDirectory folder;
  Context context(test_device());
  TraceOptions trace;
  trace.depth = true;
  trace.max_hits = 1;
  Tracer tracer(context, trace);
  Gaussians balls = red_balls();
  balls.means = {0, 0, 0, 0, 0, 4};
  balls.opacities = {0.0f, 8.0f};
  const Model model(context, balls);
  // It looks at the balls, then away.
  std::vector<Camera> cameras{look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 17, 11, 15.0),
                              look_at({0, 0, -4}, {0, 0, -8}, {0, -1, 0}, 17, 11, 15.0)};
  FrameOptions options;
  options.format = FrameFormat::kExr;
  options.depth = options.hits = true;
  options.shutter = 1.0;
  const FrameReport sharp = write_frames(tracer, model, cameras, folder.path(), options);
  const fs::path first = folder.path() / "frame_0000.exr";
  const std::vector<float> z = exr_channel(first, "Z"), hits = exr_channel(first, "hits");
  REQUIRE(z[5 * 17 + 8] > 3.0f);
  REQUIRE(sharp.capped_rays > 0);
  cameras.push_back(cameras.back());
  // Moments at 0 and half of the way, where nothing is seen any more.
  options.shutter_samples = 2;
  const FrameReport blurred = write_frames(tracer, model, cameras, folder.path(), options);
  const std::vector<float> mean = exr_channel(first, "Z"), half = exr_channel(first, "hits");
  for (std::size_t i = 0; i < z.size(); ++i) {
    CHECK(mean[i] == doctest::Approx(z[i]).epsilon(1e-5));
    CHECK(half[i] == doctest::Approx(0.5f * hits[i]));
  }
  CHECK(blurred.capped_rays == sharp.capped_rays);
}

TEST_CASE("motion blur leaves still cameras of different sizes and lenses as they are") {
  const TemporaryDirectory folder;
  Context context(test_device());
  Tracer tracer(context, {});
  const Model model(context, red_balls());
  const auto still = [](const char* name, int width, int height, double focal) {
    Camera camera = look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, width, height, focal);
    camera.name = name;
    return camera;
  };
  const Camera small = still("small.png", 17, 11, 15.0), large = still("large.png", 33, 21, 30.0);
  Camera fisheye = still("fisheye.png", 33, 21, 12.0);
  fisheye.model = CameraModel::kFisheye;
  fisheye.distortion.k1 = 0.05;
  const std::vector<Camera> pairs[] = {
      {small, large}, {large, small}, {large, fisheye}, {fisheye, large}};
  FrameOptions options;
  options.format = FrameFormat::kExr;
  options.linear_exr = false;
  options.shutter = 1.0;
  for (const std::vector<Camera>& cameras : pairs) {
    options.shutter_samples = 1;
    write_frames(tracer, model, cameras, folder.path() / "sharp", options);
    options.shutter_samples = 2;
    CHECK(write_frames(tracer, model, cameras, folder.path() / "blurred", options).frames == 2);
    for (const std::string& name : frame_names(cameras)) {
      CAPTURE(cameras[0].name);
      CAPTURE(name);
      const Image sharp = read_image(folder.path() / "sharp" / (name + ".exr"));
      const Image blurred = read_image(folder.path() / "blurred" / (name + ".exr"));
      REQUIRE(blurred.width == sharp.width);
      REQUIRE(blurred.height == sharp.height);
      double worst = 0.0;
      for (std::size_t i = 0; i < sharp.data.size(); ++i)
        worst = std::max(worst, static_cast<double>(std::abs(blurred.data[i] - sharp.data[i])));
      CHECK(worst < 1e-3);
    }
  }
  Image sum(17, 11, 4);
  CHECK_THROWS_AS(add(sum, Image(33, 21, 4)), Error);
}

TEST_CASE("frames hold what the tracer saw") {
  const TemporaryDirectory folder;
  Context context(test_device());
  TraceOptions trace;
  trace.background = {0.0f, 0.0f, 1.0f};
  trace.depth = true;
  Tracer tracer(context, trace);
  const Model model(context, red_balls());
  Camera camera = look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 33, 21, 30.0);
  camera.name = "views/ball.png";
  const std::vector<Camera> cameras{camera};

  FrameOptions options;
  options.format = FrameFormat::kExr;
  options.linear_exr = false;
  options.depth = true;
  options.supersample = 2;
  std::size_t heard = 0;
  const FrameReport report =
      write_frames(tracer, model, cameras, folder.path(), options, [&](std::size_t done) {
        heard = done;
        return true;
      });
  CHECK(heard == 1);
  CHECK(report.frames == 1);
  CHECK(report.rays == 4u * 33u * 21u);
  CHECK(report.capped_rays == 0);

  const std::vector<float> z = exr_channel(folder.path() / "ball.exr", "Z");
  CHECK(z[10 * 33 + 16] == doctest::Approx(4.0f).epsilon(0.01));
  CHECK(z[10 * 33 + 24] == doctest::Approx(8.0f).epsilon(0.01));
  CHECK(z[0] == 0.0f);

  // The independent view of the same frame: four rays per pixel averaged from a picture of twice
  // the size.
  CameraTracer packets(context, trace);
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(context, red_balls(), ScaleActivation::kExp);
  packets.update(gaussians);
  packets.forward(gaussians, downscaled(camera, 0.5));
  const Image expected = box_average(packets.download_image(), 2);
  options.depth = false;
  write_frames(tracer, model, cameras, folder.path(), options);
  const Image exr = read_image(folder.path() / "ball.exr");
  REQUIRE(exr.channels == 4);
  double worst = 0.0;
  for (std::size_t i = 0; i < exr.data.size(); ++i) {
    worst = std::max(worst, static_cast<double>(std::abs(exr.data[i] - expected.data[i])));
  }
  CHECK(worst < 1e-6);
  CHECK(exr.at(16, 10, 0) > 0.8f);
  CHECK(exr.at(16, 10, 3) > 0.9f);
  CHECK(exr.at(0, 0, 2) == doctest::Approx(1.0f));
  CHECK(exr.at(0, 0, 3) == doctest::Approx(0.0f));

  // Proportional to light: what is 0.5 on the screen is a fifth of the light of 1.
  options.linear_exr = true;
  write_frames(tracer, model, cameras, folder.path(), options);
  const Image linear = read_image(folder.path() / "ball.exr");
  worst = 0.0;
  for (std::size_t i = 0; i < linear.data.size(); ++i) {
    const double v = expected.data[i];
    const double light = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
    worst = std::max(worst, std::abs(linear.data[i] - (i % 4 == 3 ? v : light)));
  }
  CHECK(worst < 1e-5);
  options.linear_exr = false;

  options.format = FrameFormat::kPng;
  options.depth = true;
  write_frames(tracer, model, cameras, folder.path(), options);
  const Image png = read_image(folder.path() / "ball.png");
  REQUIRE(png.channels == 3);
  CHECK(png.at(16, 10, 0) == doctest::Approx(exr.at(16, 10, 0)).epsilon(0.01));
  CHECK(png.at(0, 0, 2) == 1.0f);
  const Image depth = read_image(folder.path() / "ball_depth.png");
  CHECK(depth.channels == 1);
  CHECK(depth.at(16, 10, 0) > 0.9f);
  CHECK(depth.at(24, 10, 0) < 0.1f);
  CHECK(depth.at(0, 0, 0) == 0.0f);

  // A camera that packets cannot trace.
  Camera panorama = camera;
  panorama.model = CameraModel::kEquirectangular;
  panorama.name = "panorama.png";
  panorama.width = 64;
  panorama.height = 32;
  options.format = FrameFormat::kExr;
  options.supersample = 1;
  write_frames(tracer, model, std::vector<Camera>{panorama}, folder.path(), options);
  const std::vector<float> around = exr_channel(folder.path() / "panorama.exr", "Z");
  CHECK(around[16 * 64 + 32] == doctest::Approx(4.0f).epsilon(0.02));
  CHECK(around[16 * 64] == 0.0f);

  options.supersample = 0;
  CHECK_THROWS_AS(write_frames(tracer, model, cameras, folder.path(), options), UsageError);
}

TEST_CASE("frames hold normals and numbers of hits where they are asked for") {
  const TemporaryDirectory folder;
  Context context(test_device());
  TraceOptions trace;
  trace.depth = true;
  Tracer tracer(context, trace);
  Gaussians balls = red_balls();
  // A disc that faces the camera, thinnest along z.
  balls.log_scales[2] = std::log(0.01f);
  const Model model(context, balls);
  Camera camera = look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 33, 21, 30.0);
  camera.name = "ball.png";
  FrameOptions options;
  options.format = FrameFormat::kExr;
  options.normals = options.hits = true;
  options.supersample = 2;
  write_frames(tracer, model, std::vector<Camera>{camera}, folder.path(), options);
  const std::size_t middle = 10 * 33 + 16;
  const std::vector<float> z = exr_channel(folder.path() / "ball.exr", "N.Z");
  CHECK(z[middle] == doctest::Approx(-1.0f).epsilon(0.001));
  CHECK(z[0] == 0.0f);
  CHECK(exr_channel(folder.path() / "ball.exr", "N.X")[middle] == doctest::Approx(0.0f));
  CHECK(exr_channel(folder.path() / "ball.exr", "hits")[middle] == 1.0f);
  CHECK(exr_channel(folder.path() / "ball.exr", "hits")[0] == 0.0f);
  options.format = FrameFormat::kPng;
  write_frames(tracer, model, std::vector<Camera>{camera}, folder.path(), options);
  const Image normals = read_image(folder.path() / "ball_normals.png");
  CHECK(normals.at(16, 10, 2) == doctest::Approx(1.0f).epsilon(0.01));
  CHECK(normals.at(16, 10, 0) == doctest::Approx(0.5f).epsilon(0.01));
  // At the edge rays meet the further ball as well.
  CHECK(read_image(folder.path() / "ball_hits.png").at(16, 10, 0) ==
        doctest::Approx(0.5).epsilon(0.01));
  CHECK_FALSE(fs::exists(folder.path() / "ball_depth.png"));
}
