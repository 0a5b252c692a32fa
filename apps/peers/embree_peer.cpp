// SPDX-License-Identifier: Apache-2.0
// Embree 3 and RaySplats-CL on the same Gaussians, run in turn within one process.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <thread>
#include <vector>

#include "embree_tracer.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "scene/image/pixel_count.hpp"
#include "scene/morton_order.hpp"
#include "side_by_side.hpp"

namespace raysplats::peer {
namespace {

struct Options {
  std::string scene = "random";
  std::size_t count = 100'000;
  std::uint64_t seed = 42;
  std::string model;
  std::string cameras;
  std::size_t view = 0;
  int size = 800;
  int repeat = 5;
  int threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  float min_transmittance = 1e-3f;
  std::string device;
  std::vector<std::string> work{"camera", "rays", "build", "refit"};
  std::vector<std::string> programs;
  bool header = true;
};

struct Variant {
  const char* name;
  EmbreeTraceOptions options;
};
constexpr Variant kVariants[] = {
    {"embree-packets-k64", {EmbreeRays::kPackets, 64}},
    {"embree-packets-k16", {EmbreeRays::kPackets, 16}},
    {"embree-single-k64", {EmbreeRays::kSingle, 64}},
    {"embree-single-k16", {EmbreeRays::kSingle, 16}},
};

bool contains(const std::vector<std::string>& names, const char* name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

Options parse(int argc, char** argv) {
  Options o;
  for (const Variant& variant : kVariants) o.programs.emplace_back(variant.name);
  CLI::App app{
      "Runs Embree 3 and RaySplats-CL in turn on the same Gaussians and prints one CSV row per "
      "program and kind of work. The difference columns compare a program's colours with those of "
      "the first row of its kind (ours).",
      "embree_peer"};
  app.add_option("--scene", o.scene, "benchmark scene")->capture_default_str();
  app.add_option("--count", o.count, "Gaussians of the scene")->capture_default_str();
  app.add_option("--seed", o.seed, "seed of the scene and of the rays")->capture_default_str();
  app.add_option("--model", o.model, "3DGS PLY to trace instead of a scene (SH degree 0 of it)");
  app.add_option("--cameras", o.cameras, "transforms.json with the cameras of the model");
  app.add_option("--view", o.view, "index of the camera in that file")->capture_default_str();
  app.add_option("--size", o.size, "width and height in pixels of the benchmark camera")
      ->capture_default_str()
      ->check(CLI::Range(16, 8192));
  app.add_option("--repeat", o.repeat, "measured runs of each program")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  app.add_option("--threads", o.threads, "threads of Embree")->capture_default_str();
  app.add_option("--min-transmittance", o.min_transmittance, "a ray stops below this")
      ->capture_default_str();
  app.add_option("--device", o.device, "OpenCL device of ours: index or part of its name");
  app.add_option("--work", o.work, "kinds of work")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::IsMember({"camera", "rays", "build", "refit"}));
  app.add_option("--programs", o.programs, "variants of Embree that trace rays")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::IsMember(o.programs));
  app.add_flag("!--no-header", o.header, "leave out the line with the names of the columns");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    std::exit(app.exit(error) == 0 ? 0 : 2);
  }
  return o;
}

void print(const Options& options,
           const char* work,
           std::size_t gaussians,
           std::size_t units,
           const std::vector<Result>& results) {
  const std::string scene = options.model.empty() ? options.scene : "model";
  for (const Result& r : results) {
    fmt::print("{},{},{},{},{},{:.3f},{:.3f},{:.4f},{:.3f},{:.3f},{:.6f},{:.3g},{:.3g}\n", work,
               r.name, scene, gaussians, units, r.median_ms, r.min_ms,
               1e-3 * static_cast<double>(units) / r.median_ms, r.last.hits_per_ray,
               r.last.traces_per_ray, r.mean_color, r.max_difference, r.mean_difference);
  }
  std::fflush(stdout);
}

/// Embree's results in the order of `targets` (one entry per ray: a pixel, or npos for none).
Outcome embree_outcome(const EmbreeTracer& embree,
                       std::span<const Ray> rays,
                       const std::vector<std::size_t>& targets,
                       std::size_t target_count,
                       const EmbreeTraceOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const std::vector<EmbreeResult> results = embree.trace(rays, options);
  Outcome outcome;
  outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  outcome.colors.resize(target_count);
  outcome.traces_per_ray = 0.0;
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (targets[i] == CameraRays::npos) continue;
    const EmbreeResult& r = results[i];
    outcome.colors[targets[i]] = {r.color[0], r.color[1], r.color[2]};
    outcome.hits_per_ray += r.hits;
    outcome.traces_per_ray += r.traces;
  }
  outcome.hits_per_ray /= static_cast<double>(target_count);
  outcome.traces_per_ray /= static_cast<double>(target_count);
  return outcome;
}

void run(const Options& options) {
  // Both sides read their records in the order in which our programs keep models.
  const Gaussians model = in_morton_order(
      options.model.empty() ? bench_scene(options.scene, options.count, options.seed)
                            : with_sh_degree(read_ply(options.model), 0));
  Camera camera = bench_camera(options.size, options.size);
  if (!options.cameras.empty()) {
    const std::vector<Camera> cameras = read_cameras(options.cameras);
    if (options.view >= cameras.size()) {
      throw UsageError(fmt::format("{} has no view {}, give a number below {}.", options.cameras,
                                   options.view, cameras.size()));
    }
    camera = cameras[options.view];
  }
  TraceOptions trace;
  trace.min_transmittance = options.min_transmittance;
  trace.memory_budget = std::size_t{4} << 30;
  OurTracer ours(options.device, model, trace);
  EmbreeTracer embree(model, trace.quantile, trace.min_transmittance, options.threads);
  const auto wants = [&](const char* work) { return contains(options.work, work); };
  fmt::print(stderr, "{} Gaussians; ours on {}, Embree on {} threads\n", model.size(),
             ours.device_name(), options.threads);
  if (options.header) {
    fmt::print(
        "work,program,scene,gaussians,units,median_ms,min_ms,million_units_per_s,hits_per_ray,"
        "traces_per_ray,mean_color,max_difference,mean_difference\n");
  }

  if (wants("build")) {
    const auto build = [&](RTCBuildQuality quality) {
      return [&, quality] {
        Outcome outcome;
        outcome.seconds = embree.build(quality);
        return outcome;
      };
    };
    print(options, "build", model.size(), model.size(),
          run_in_turn({{"ours", [&] { return ours.build(); }},
                       {"embree-morton", build(RTC_BUILD_QUALITY_LOW)},
                       {"embree-sah", build(RTC_BUILD_QUALITY_MEDIUM)}},
                      options.repeat));
  }
  if (wants("refit")) {
    const auto refit = [&] {
      Outcome outcome;
      outcome.seconds = embree.refit();
      return outcome;
    };
    print(options, "refit", model.size(), model.size(),
          run_in_turn({{"ours", [&] { return ours.refit(); }}, {"embree-refit", refit}},
                      options.repeat));
  }

  embree.build(RTC_BUILD_QUALITY_MEDIUM);
  const auto trace_work = [&](const char* work, const Contestant& our_side,
                              std::span<const Ray> rays, const std::vector<std::size_t>& targets,
                              std::size_t target_count) {
    std::vector<Contestant> contestants{our_side};
    for (const Variant& variant : kVariants) {
      if (!contains(options.programs, variant.name)) continue;
      contestants.push_back({variant.name, [&, variant] {
                               return embree_outcome(embree, rays, targets, target_count,
                                                     variant.options);
                             }});
    }
    print(options, work, model.size(), target_count, run_in_turn(contestants, options.repeat));
  };
  if (wants("camera")) {
    const CameraRays rays = camera_rays(camera);
    const std::size_t pixels = pixel_count(camera);
    trace_work("camera", {"ours", [&] { return ours.camera(camera); }}, rays.rays, rays.pixels,
               pixels);
  }
  if (wants("rays")) {
    const std::size_t side = static_cast<std::size_t>(options.size) / 4 * 4;
    const std::vector<Ray> rays = bench_rays(side * side, options.seed);
    std::vector<std::size_t> targets(rays.size());
    for (std::size_t i = 0; i < targets.size(); ++i) targets[i] = i;
    trace_work("rays", {"ours", [&] { return ours.rays(rays); }}, rays, targets, rays.size());
  }
}

}  // namespace
}  // namespace raysplats::peer

int main(int argc, char** argv) {
  try {
    raysplats::peer::run(raysplats::peer::parse(argc, argv));
    return 0;
  } catch (const raysplats::Error& error) {
    fmt::print(stderr, "embree_peer: {}\n", error.what());
    return static_cast<int>(error.code());
  } catch (const std::exception& error) {
    fmt::print(stderr, "embree_peer: {}\n", error.what());
    return 1;
  }
}
