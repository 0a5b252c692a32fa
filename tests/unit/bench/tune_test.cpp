// SPDX-License-Identifier: Apache-2.0
#include "bench/tune.hpp"

#include <doctest/doctest.h>

#include <algorithm>

#include "device/tuning.hpp"
#include "raysplats/error.hpp"
#include "synth/bench_scenes.hpp"
#include "trace/camera_tracer.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;

TEST_CASE("tune: candidates are valid, differ in one axis and begin with the current choice") {
  DeviceInfo device;
  device.type = DeviceType::kCpu;
  device.float_vector_width = 8;
  device.max_work_group_size = 64;
  const DeviceTuning start = default_tuning(device);
  CHECK(start.packet_width == 16);
  for (const std::string& axis : tune_axes()) {
    const std::vector<DeviceTuning> candidates = tune_candidates(axis, start, device);
    if (axis == "packet-shape") {
      CHECK(candidates == std::vector<DeviceTuning>{start});
      continue;
    }
    REQUIRE(candidates.size() > 1);
    CHECK(candidates.front() == start);
    for (std::size_t i = 1; i < candidates.size(); ++i) {
      const DeviceTuning& c = candidates[i];
      CHECK(is_valid(c));
      CHECK((c.packet_width != start.packet_width) + (c.tile != start.tile) +
                (c.pending != start.pending) + (c.group != start.group) + (c.bvh != start.bvh) ==
            1);
      CHECK(c.group <= 64);
      CHECK(std::count(candidates.begin(), candidates.end(), c) == 1);
    }
  }
}

TEST_CASE("tune: GPUs try groups and vectors, each in its own widths") {
  DeviceInfo device;
  device.type = DeviceType::kGpu;
  device.local_memory = 32768;
  device.max_work_group_size = 256;
  const DeviceTuning start = default_tuning(device);
  CHECK(start.grouped);
  CHECK(start.packet_width == 32);
  const std::vector<DeviceTuning> shapes = tune_candidates("packet-shape", start, device);
  REQUIRE(shapes.size() == 2);
  CHECK_FALSE(shapes[1].grouped);
  CHECK(tune_candidates("packet-shape", shapes[1], device)[1] == start);
  for (const DeviceTuning& shape : shapes) {
    for (const DeviceTuning& c : tune_candidates("packet-width", shape, device)) {
      CHECK(is_valid(c));
      CHECK(c.grouped == shape.grouped);
    }
  }
  device.has_subgroups = true;
  const DeviceTuning subgroup = default_tuning(device);
  CHECK(subgroup.subgroups);
  const std::vector<DeviceTuning> three = tune_candidates("packet-shape", subgroup, device);
  REQUIRE(three.size() == 3);
  CHECK(std::count(three.begin(), three.end(), start) == 1);
  CHECK(std::count(three.begin(), three.end(), shapes[1]) == 1);
  for (const DeviceTuning& c : tune_candidates("packet-width", subgroup, device)) {
    CHECK(is_valid(c));
    CHECK(c.subgroups);
  }
  CHECK(tune_candidates("pending", start, device).size() == 1);
  CHECK(tune_candidates("pending", shapes[1], device).size() > 1);
}

TEST_CASE("tune: measures the axes and leaves the winner in the context") {
  ContextOptions timed;
  timed.profile = timed.keep_launches = true;
  timed.tuning = false;
  Context context(test_device(), timed);
  TuneOptions options;
  options.size = 200;
  options.width = options.height = 32;
  options.repeat = 1;
  options.axes = {"tile", "group", "traversal"};
  std::size_t heard = 0;
  const TuneResult result = tune_device(context, options, [&](const TuneTrial&) { ++heard; });
  CHECK(heard == result.trials.size());
  CHECK(is_valid(result.best));
  CHECK(context.device().tuning == result.best);
  CHECK(result.start == default_tuning(context.device()));
  CHECK(result.speedup > 0);
  for (const std::string& axis : options.axes) {
    const auto runs =
        std::count_if(result.trials.begin(), result.trials.end(), [&](const TuneTrial& trial) {
          return trial.axis == axis && trial.problem.empty() && trial.seconds > 0;
        });
    CHECK(runs > 0);
  }
  options.scene = "no such scene";
  CHECK_THROWS_AS(tune_device(context, options), UsageError);
}

TEST_CASE("tune: the picture and the gradients do not depend on the tuning") {
  ContextOptions plain;
  plain.tuning = false;
  Context context(test_device(), plain);
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(context, bench_scene("clustered", 2000, 5), ScaleActivation::kExp);
  const Camera camera = bench_camera(70, 50);
  std::vector<float> picture, means;
  for (const DeviceTuning& tuning :
       {DeviceTuning{false, 4, 32, 96, 0}, DeviceTuning{false, 4, 16, 24, 1},
        DeviceTuning{false, 4, 64, 7, 16}, DeviceTuning{false, 4, 8, 128, 2}}) {
    INFO("tile " << tuning.tile << ", pending " << tuning.pending << ", group " << tuning.group);
    context.set_tuning(tuning);
    CameraTracer tracer(context, TraceOptions{});
    tracer.update(gaussians);
    tracer.forward(gaussians, camera, true);
    Buffer<float> gradient(context, tracer.image().size(), "image gradient");
    gradient.upload(std::vector<float>(gradient.size(), 1e-3f));
    GaussianGradients gradients;
    tracer.backward(gaussians, gradient, gradients);
    const std::vector<float> image = tracer.image().download();
    const std::vector<float> mean_gradient = gradients.means.download();
    if (picture.empty()) {
      picture = image;
      means = mean_gradient;
    }
    REQUIRE(image.size() == picture.size());
    float worst = 0, worst_gradient = 0, largest = 0;
    for (std::size_t i = 0; i < image.size(); ++i) {
      worst = std::max(worst, std::abs(image[i] - picture[i]));
    }
    for (std::size_t i = 0; i < means.size(); ++i) {
      worst_gradient = std::max(worst_gradient, std::abs(mean_gradient[i] - means[i]));
      largest = std::max(largest, std::abs(means[i]));
    }
    CHECK(worst <= 1e-6f);
    CHECK(largest > 0);
    CHECK(worst_gradient <= 1e-4f * largest);
  }
}
