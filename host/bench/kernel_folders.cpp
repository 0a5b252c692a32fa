// SPDX-License-Identifier: Apache-2.0
#include "bench/kernel_folders.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <set>
#include <utility>

#include "bench/bench_cases.hpp"
#include "bench/larger.hpp"
#include "bench/scene_bench.hpp"
#include "light/view_tracer.hpp"
#include "scene/image/pixel_count.hpp"
#include "scene/options/trace_option_table.hpp"
#include "trace/packet_layout.hpp"
#include "trace/ray_tracer.hpp"
#include "train/loss/image_loss.hpp"
#include "train/optimizer/adam.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

constexpr double kRate = 1e-3;  // of the step of Adam that is compared

struct NamedNumbers {
  std::string name;
  std::vector<float> numbers;
};

void add(std::vector<NamedNumbers>& out, const std::string& name, const Parameters& parameters) {
  for (const ParameterGroup group : kParameterGroups)
    out.push_back({name + group_name(group), parameters[group].download()});
}

// A step of training by one of the ways to trace.
void add_step(Context& context,
              const BenchModel& model,
              const TraceOptions& trace,
              const std::string& way,
              std::vector<NamedNumbers>& out) {
  DeviceGaussians gaussians =
      DeviceGaussians::upload(context, model.gaussians, ScaleActivation::kExp);
  const int width = model.camera.width, height = model.camera.height;
  ViewTracer tracer(context, trace);
  tracer.forward(gaussians, model.camera, true);
  out.push_back({way + "image", tracer.image().download()});
  CounterRng random(7, 1);
  std::vector<std::uint32_t> photo(pixel_count(width, height));
  for (std::uint32_t& pixel : photo) pixel = static_cast<std::uint32_t>(random.bits());
  Buffer<std::uint32_t> target(context, photo.size(), "photo");
  target.upload(photo);
  ImageLoss loss(context, PixelLoss::kL1, {0.2f});
  Buffer<float> image_gradient;
  loss.evaluate(tracer.image(), {target}, false, {0, 0, 0}, width, height, image_gradient);
  out.push_back({way + "gradient of the image", image_gradient.download()});
  GaussianGradients gradients;
  tracer.backward(gaussians, image_gradient, gradients);
  add(out, way + "gradients of ", gradients);
  Adam adam(context, {});
  adam.step(gaussians, gradients, {kRate, kRate, kRate, kRate, kRate, kRate});
  add(out, way + "after a step: ", gaussians);
}

std::vector<NamedNumbers> results_of(Context& context,
                                     const BenchModel& model,
                                     const BenchOptions& options) {
  TraceOptions trace = options.trace;
  trace.deterministic = true;
  std::vector<NamedNumbers> out;
  trace.traversal = Traversal::kTiles;
  add_step(context, model, trace, "tiles, ", out);
  trace.traversal = Traversal::kBvh;
  add_step(context, model, of_bare_rays(trace), "tree, ", out);  // with gradients
  return out;
}

// Rows whose results are those of results_of() or go into them.
std::set<std::string> compared_rows(const DeviceInfo& device, const TraceOptions& trace) {
  const PacketLayout packet = packet_layout(device, trace);
  const std::string shape = packet_shape_name(packet.subgroups ? PacketShape::kSubgroup
                                              : packet.grouped ? PacketShape::kGroup
                                                               : PacketShape::kVector);
  std::set<std::string> rows{"sort",
                             "bounds",
                             "order",
                             "nodes",
                             "build",
                             "prepare-view",
                             "tile-lists",
                             "forward",
                             "view",
                             "view-bvh",
                             "backward",
                             "finalize",
                             "loss-gradient",
                             "adam",
                             "forward-" + shape,
                             "backward-" + shape};
  if (has_cones(trace)) rows.erase("view-bvh");  // its gradients are those of bare rays
  return rows;
}

// Each name once, in the order of the rows.
std::vector<std::string> uncompared_rows(const BenchReport& report,
                                         std::set<std::string> compared) {
  std::vector<std::string> out;
  for (const BenchRow& row : report.rows) {
    if (compared.insert(row.name).second) out.push_back(row.name);
  }
  return out;
}

// One folder's side of the comparison of one scene.
struct Side {
  Side(Context& context_in,
       const BenchModel& model,
       const BenchOptions& options,
       const IdFilter& keep)
      : context(context_in),
        bench(context_in, model, options),
        operations(selected(bench.operations(), keep, model.name, model.gaussians.size())),
        samples(operations.size()) {
    for (std::size_t i = 0; i < operations.size(); ++i)
      samples[i].resize(operations[i].stages.size());
  }

  void measure(double min_seconds) {
    const auto more = run_operations(context, operations, 1, min_seconds);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      for (std::size_t k = 0; k < samples[i].size(); ++k) {
        StageSamples& all = samples[i][k];
        const StageSamples& now = more[i][k];
        all.seconds.insert(all.seconds.end(), now.seconds.begin(), now.seconds.end());
        all.wall.insert(all.wall.end(), now.wall.begin(), now.wall.end());
      }
    }
  }

  void add_rows(const BenchModel& model, BenchReport& report) const {
    for (std::size_t i = 0; i < operations.size(); ++i) {
      for (std::size_t k = 0; k < operations[i].stages.size(); ++k) {
        if (samples[i][k].seconds.empty()) continue;  // the device does not have it
        report.rows.push_back(
            row_of(operations[i].stages[k], samples[i][k], model.name, model.gaussians.size()));
      }
    }
  }

  Context& context;
  SceneBench bench;
  std::vector<BenchOperation> operations;
  std::vector<std::vector<StageSamples>> samples;
};

}  // namespace

ResultDifference difference_of(std::string name,
                               std::span<const float> before,
                               std::span<const float> after) {
  ResultDifference out;
  out.name = std::move(name);
  out.numbers = before.size();
  double largest = 0, scale = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    scale = std::max(scale, std::abs(static_cast<double>(before[i])));
    if (std::bit_cast<std::uint32_t>(before[i]) == std::bit_cast<std::uint32_t>(after[i])) continue;
    ++out.differing;
    largest =
        larger(largest, std::abs(static_cast<double>(before[i]) - static_cast<double>(after[i])));
  }
  out.largest = scale > 0 ? largest / scale : largest;
  return out;
}

bool KernelComparison::equal() const {
  return std::all_of(results.begin(), results.end(),
                     [](const ResultDifference& result) { return result.differing == 0; });
}

KernelComparison compare_kernels(const DeviceInfo& device,
                                 const ContextOptions& context_options,
                                 const std::string& folder,
                                 const std::string& other,
                                 const BenchOptions& options) {
  const std::vector<BenchCase> cases = wanted_cases(options);
  const IdFilter keep = id_filter(options.filter);
  ContextOptions own = context_options;
  own.kernel_directory = folder;
  Context first(device, own);
  own.kernel_directory = other;
  Context second(device, own);
  KernelComparison out;
  BenchReport before = bench_header(first, options, nullptr);
  BenchReport after = bench_header(second, options, nullptr);
  for (const BenchCase& one : cases) {
    spdlog::info("{}: {} Gaussians", one.scene, one.size);
    const BenchModel model = generated(one, options);
    const std::vector<NamedNumbers> a = results_of(first, model, options);
    const std::vector<NamedNumbers> b = results_of(second, model, options);
    for (std::size_t i = 0; i < a.size(); ++i) {
      out.results.push_back(difference_of(fmt::format("{}/{}: {}", one.scene, one.size, a[i].name),
                                          a[i].numbers, b[i].numbers));
    }
    Side left(first, model, options, keep), right(second, model, options, keep);
    for (int round = 0; round < options.repeat; ++round) {
      // Whoever is second finds warmer caches: they take turns at that, too.
      Side* order[2] = {&left, &right};
      if (round % 2 == 1) std::swap(order[0], order[1]);
      for (Side* side : order) side->measure(options.min_seconds);
    }
    left.add_rows(model, before);
    right.add_rows(model, after);
  }
  out.rows = compare_reports(before, after);
  out.uncompared = uncompared_rows(before, compared_rows(first.device(), options.trace));
  return out;
}

std::string kernel_comparison_table(const KernelComparison& comparison) {
  std::string out;
  for (const ResultDifference& result : comparison.results) {
    if (result.differing == 0) continue;
    out += fmt::format("{}: {} of {} numbers differ, by {:.2e} of the largest\n", result.name,
                       result.differing, result.numbers, result.largest);
  }
  if (comparison.equal()) {
    out += fmt::format(
        "the {} pictures, gradients and parameters after a step are equal to the last bit\n",
        comparison.results.size());
  }
  if (!comparison.uncompared.empty()) {
    out += fmt::format("what these rows yield besides is not compared, but by the tests: {}\n",
                       fmt::join(comparison.uncompared, ", "));
  }
  return out + comparison_table(comparison.rows);
}

}  // namespace raysplats
