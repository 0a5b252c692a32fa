// SPDX-License-Identifier: Apache-2.0
#include "bench/speed_model.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "bench/cards.hpp"
#include "bench/executed_work.hpp"
#include "bench/forecast.hpp"
#include "bench/scene_bench.hpp"
#include "build_paths.hpp"
#include "raysplats/error.hpp"
#include "synth/bench_scenes.hpp"
#include "trace/camera_tracer.hpp"
#include "unit/bench/report_fixture.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;

namespace {

DeviceSpeeds sample_device() {
  DeviceSpeeds device;
  device.vectors = 100;
  device.slow = 10;
  device.bandwidth = {{1000, 50}, {INFINITY, 5}};
  device.local = 20;
  device.atomics = 4;
  device.clock = 10;
  device.issue_cycles = 2;
  device.trip_cycles = 30;
  device.local_cycles = 5;
  device.launch_seconds = 0.25;
  return device;
}

}  // namespace

TEST_CASE("the model of speed takes the slowest of what a device does side by side") {
  const DeviceSpeeds device = sample_device();
  const auto check = [&](const KernelWork& work, double resident, double seconds,
                         const char* bound) {
    const Prediction found = predict(work, device, resident);
    CHECK(found.seconds == doctest::Approx(seconds));
    CHECK(found.bound == bound);
  };
  check({.vectors = 200, .scalars = 100, .slow = 5}, 0, 3.0, "arithmetic");
  check({.vectors = 200, .slow = 50}, 0, 5.0, "arithmetic");
  check({.vectors = 200, .bytes = 500, .footprint = 1000}, 0, 10.0, "memory");
  check({.vectors = 200, .bytes = 500, .footprint = 1001}, 0, 100.0, "memory");
  check({.lines = 10, .table = 900}, 0, 12.8, "memory");
  check({.vectors = 100, .local = 60}, 0, 3.0, "local memory");
  check({.vectors = 100, .atomics = 60}, 0, 15.0, "atomics");
  // 400 cycles of instructions, 300 of waits, 100 of barriers, by two waves at once.
  check({.vectors = 200, .trips = 10, .barriers = 20}, 2, 40.0, "latency");
  check({.vectors = 100, .launches = 8}, 0, 3.0, "launches");
}

TEST_CASE("the model of speed adds up what a processor does one after the other") {
  DeviceSpeeds device = sample_device();
  device.cpu = true;
  device.scalars = 200;
  device.lines = {{INFINITY, 8}};
  device.chases = {{INFINITY, 2}};
  device.stores = {{INFINITY, 4}};
  const KernelWork work{.vectors = 200, .scalars = 100, .slow = 5, .bytes = 100, .footprint = 10};
  CHECK(predict(work, device).seconds == doctest::Approx(3.0));
  device.shifted = 5;
  device.parked = 40;
  CHECK(predict(work + KernelWork{.shifted = 1, .parked = 8}, device).seconds ==
        doctest::Approx(3.4));
  device.runs = {{INFINITY, 16}};
  const KernelWork random{.lines = 8, .runs = 4, .chases = 1, .stores = 2};
  const Prediction found = predict(work + random, device);
  CHECK(found.seconds == doctest::Approx(3.0 + 1.0 + 0.25 + 0.5 + 0.5));
  CHECK(found.bound == "arithmetic");
  CHECK(predict(random, device).bound == "memory");
  device.tiled = {{100, 80}, {INFINITY, 20}};
  CHECK(predict(work + KernelWork{.footprint = 200, .tiled = 10}, device).seconds ==
        doctest::Approx(3.5));
}

TEST_CASE("the model of speed lets the other processors come late to every launch") {
  DeviceSpeeds device = sample_device();
  device.cpu = true;
  device.processors = 3;
  device.late_seconds = 0.3;
  // Two of three miss 0.3 seconds of each launch, but no more than there is to do.
  CHECK(predict({.vectors = 200, .shared = 4}, device).seconds == doctest::Approx(2.8));
  const Prediction small = predict({.vectors = 1, .shared = 4}, device);
  CHECK(small.seconds == doctest::Approx(0.03));
  CHECK(small.bound == "launches");
}

TEST_CASE("the model's registers and local memory are those of the compilers' baseline") {
  std::ifstream file(std::filesystem::path(test::source_dir()) / "scripts/gpu/baseline.json");
  const nlohmann::json baseline = nlohmann::json::parse(file);
  for (const CompiledKernel& kernel : compiled_kernels()) {
    CAPTURE(kernel.target);
    CAPTURE(kernel.name);
    const nlohmann::json& figures = baseline.at(kernel.target).at(kernel.name);
    CHECK(kernel.registers == figures.at("registers").get<double>());
    CHECK(kernel.local == figures.at("local").get<double>());
    CHECK(kernel.width == figures.at("width").get<double>());
  }
  const Card& hopper = cards().back();
  // 99 registers of 32 lanes are given out in eights: 19 of 65536 / 32 / 104; a group each.
  const CompiledKernel kernel{"sm_90", "", 99, 1024, 32, 32};
  CHECK(resident_waves(hopper, kernel) == 19 * hopper.units);
  CHECK_THROWS_AS(compiled_kernel("densify", "sm_90"), UsageError);
  CHECK_THROWS_AS(executed_work("densify", {}), UsageError);
}

TEST_CASE("kernels that count their work find the same hits and change no pixel") {
  Context context(test_device(), timed_options());
  const BenchOptions options = tiny_bench(1);
  const BenchModel model{"random", bench_scene("random", 1000, 1, 0),
                         bench_camera(options.width, options.height), true};
  SceneBench bench(context, model, options);
  const ExecutedCounts vectors = bench.counts(false), groups = bench.counts(true);
  TraceOptions trace = options.trace;
  trace.packet_shape = PacketShape::kVector;
  CameraTracer plain(context, trace), counting(context, trace);
  counting.count_work();
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(context, model.gaussians, ScaleActivation::kExp);
  for (CameraTracer* tracer : {&plain, &counting}) {
    tracer->update(gaussians);
    tracer->forward(gaussians, model.camera, true);
  }
  CHECK(plain.work().empty());
  CHECK(plain.download_image().data == counting.download_image().data);
  for (const ExecutedCounts& counts : {vectors, groups}) {
    CHECK(counts.hits == static_cast<double>(plain.statistics().hits));
    // A packet tests what it opens, opens what some of its rays blend, and every row is found once.
    CHECK(counts.tested >= counts.opened);
    CHECK(counts.found >= counts.opened);
    CHECK(counts.opened * (counts.grouped ? 32 : 16) >= counts.hits);
    CHECK(counts.opened <= counts.hits * 2);
    CHECK(counts.compared >= counts.windows / 2);
    CHECK(counts.rounds >= counts.packets / 2);
    CHECK(counts.rays == static_cast<double>(options.rays));
    CHECK(counts.ray_nodes >= counts.rays);
    CHECK(counts.ray_blocks > 0);
    for (const std::string& row : modelled_rows()) {
      CAPTURE(row);
      const KernelWork work = executed_work(row, counts);
      CHECK(work.vectors > 0);
      CHECK(work.bytes > 0);
    }
  }
  CHECK(groups.packets * 2 == vectors.packets);
  // A group of 32 rays meets what either of its halves meets.
  CHECK(groups.opened <= vectors.opened);
  CHECK(2 * groups.opened >= vectors.opened);
  for (const Card& card : cards())
    CHECK(iteration_seconds(groups, card) > view_seconds(groups, card));
}
