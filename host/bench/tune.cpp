// SPDX-License-Identifier: Apache-2.0
#include "bench/tune.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <memory>

#include "light/view_tracer.hpp"
#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"
#include "synth/bench_scenes.hpp"
#include "trace/packet_layout.hpp"

namespace raysplats {
namespace {

constexpr double kWorthwhile = 0.98;
constexpr int kRounds = 3;
constexpr std::array<int, 5> kWidths{1, 2, 4, 8, 16};
constexpr std::array<int, 4> kGroupWidths{8, 16, 32, 64};
constexpr std::array<int, 3> kTiles{16, 32, 64};
constexpr std::array<int, 7> kPending{24, 32, 48, 64, 96, 128, 192};
constexpr std::array<int, 5> kGroups{1, 16, 32, 64, 128};

// A scene on the device and what forward and backward passes of any tracer share.
class Course {
 public:
  Course(Context& context, const TuneOptions& options)
      : context_(context),
        options_(options.trace),
        camera_(bench_camera(options.width, options.height)),
        gaussians_(DeviceGaussians::upload(context,
                                           bench_scene(options.scene, options.size, options.seed),
                                           ScaleActivation::kExp)) {
    options_.packet_width = 0;
    options_.traversal = Traversal::kAuto;  // the tuning's
    const std::size_t pixels = pixel_count(options.width, options.height);
    // A gradient without structure: all pixels pull, none alike.
    std::vector<float> gradient(4 * pixels);
    for (std::size_t i = 0; i < 3 * pixels; ++i) {
      gradient[i] = 1e-6f * static_cast<float>(static_cast<int>(i * 2654435761u % 2001) - 1000);
    }
    image_gradient_ = Buffer<float>(context, gradient.size(), "image gradient");
    image_gradient_.upload(gradient);
  }

  std::unique_ptr<ViewTracer> tracer(const DeviceTuning& tuning) {
    context_.set_tuning(tuning);
    // Named, so that a shape that does not run is not another one in silence.
    options_.packet_shape = tuned_shape(tuning);
    auto out = std::make_unique<ViewTracer>(context_, options_);
    run(*out);  // compiles and allocates
    context_.finish_builds();
    return out;
  }

  // Device seconds of both passes.
  double run(ViewTracer& tracer) {
    context_.take_launches();
    tracer.forward(gaussians_, camera_, true);
    tracer.backward(gaussians_, image_gradient_, gradients_);
    double seconds = 0;
    for (const LaunchTime& launch : context_.take_launches()) seconds += launch.seconds;
    return seconds;
  }

 private:
  Context& context_;
  TraceOptions options_;
  Camera camera_;
  DeviceGaussians gaussians_;
  Buffer<float> image_gradient_;
  GaussianGradients gradients_;
};

// The least time of every candidate, in turns.
std::vector<TuneTrial> race(Course& course,
                            const std::string& axis,
                            const std::vector<DeviceTuning>& candidates,
                            int repeat) {
  std::vector<TuneTrial> trials;
  std::vector<std::unique_ptr<ViewTracer>> tracers;
  for (const DeviceTuning& candidate : candidates) {
    TuneTrial trial{axis, candidate, std::numeric_limits<double>::infinity(), ""};
    try {
      tracers.push_back(course.tracer(candidate));
    } catch (const Error& error) {
      // Beyond the device's registers, local memory or compiler: one candidate less.
      if (error.code() != ErrorCode::kDevice && error.code() != ErrorCode::kMemory) throw;
      trial.seconds = 0;
      trial.problem = error.what();
      tracers.push_back(nullptr);
    }
    trials.push_back(trial);
  }
  if (std::none_of(tracers.begin(), tracers.end(), [](const auto& t) { return t != nullptr; })) {
    throw DeviceError(trials.front().problem);
  }
  for (int turn = 0; turn < repeat; ++turn) {
    for (std::size_t i = 0; i < trials.size(); ++i) {
      if (!tracers[i]) continue;
      trials[i].seconds = std::min(trials[i].seconds, course.run(*tracers[i]));
    }
  }
  return trials;
}

const TuneTrial* find_trial(const std::vector<TuneTrial>& trials, const DeviceTuning& tuning) {
  const auto found = std::find_if(trials.begin(), trials.end(), [&](const TuneTrial& trial) {
    return trial.tuning == tuning && trial.problem.empty();
  });
  return found == trials.end() ? nullptr : &*found;
}

// The fastest trial, or `current` when that is about as fast.
DeviceTuning winner(const std::vector<TuneTrial>& trials, const DeviceTuning& current) {
  const TuneTrial* best = nullptr;
  for (const TuneTrial& trial : trials) {
    if (trial.problem.empty() && (best == nullptr || trial.seconds < best->seconds)) best = &trial;
  }
  if (best == nullptr) return current;
  const TuneTrial* now = find_trial(trials, current);
  return now != nullptr && best->seconds > kWorthwhile * now->seconds ? current : best->tuning;
}

}  // namespace

namespace {

DeviceTuning tuning_of(const DeviceInfo& device, const TraceOptions& options) {
  DeviceInfo plain = device;
  plain.tuning.reset();
  const PacketLayout layout = packet_layout(plain, options);
  return {layout.grouped, layout.lanes, layout.tile,     layout.pending,
          layout.group,   false,        layout.subgroups};
}

}  // namespace

DeviceTuning default_tuning(const DeviceInfo& device) { return tuning_of(device, {}); }

const std::vector<std::string>& tune_axes() {
  static const std::vector<std::string> axes{"packet-shape", "packet-width", "tile",
                                             "pending",      "group",        "traversal"};
  return axes;
}

std::vector<DeviceTuning> tune_candidates(const std::string& axis,
                                          const DeviceTuning& current,
                                          const DeviceInfo& device) {
  std::vector<DeviceTuning> out{current};
  const auto add = [&](auto member, int value) {
    DeviceTuning candidate = current;
    candidate.*member = value;
    if (candidate != current) out.push_back(candidate);
  };
  if (axis == "traversal") {
    DeviceTuning candidate = current;
    candidate.bvh = !current.bvh;
    out.push_back(candidate);
  } else if (axis == "packet-shape") {
    // A CPU runs the work-items of a group one after the other, and compiles them long.
    if (device.type == DeviceType::kCpu) return out;
    for (const PacketShape shape :
         {PacketShape::kVector, PacketShape::kGroup, PacketShape::kSubgroup}) {
      if (shape == PacketShape::kSubgroup && !device.has_subgroups) continue;
      TraceOptions other;
      other.packet_shape = shape;
      if (shape != tuned_shape(current)) out.push_back(tuning_of(device, other));
    }
  } else if (axis == "packet-width" && current.grouped) {
    for (const int width : kGroupWidths) {
      if (static_cast<std::size_t>(width) <= device.max_work_group_size)
        add(&DeviceTuning::packet_width, width);
    }
  } else if (axis == "packet-width") {
    for (const int width : kWidths) add(&DeviceTuning::packet_width, width);
  } else if (current.grouped && (axis == "pending" || axis == "group")) {
    return out;  // groups have neither
  } else if (axis == "tile") {
    for (const int tile : kTiles) add(&DeviceTuning::tile, tile);
  } else if (axis == "pending") {
    for (const int pending : kPending) add(&DeviceTuning::pending, pending);
  } else {
    // Sizes that differ from the whole tile, within what the device takes.
    const int packets = current.tile * current.tile / current.packet_width;
    add(&DeviceTuning::group, 0);
    for (const int group : kGroups) {
      if (group < packets && static_cast<std::size_t>(group) <= device.max_work_group_size) {
        add(&DeviceTuning::group, group);
      }
    }
  }
  return out;
}

TuneResult tune_device(Context& context,
                       const TuneOptions& options,
                       const std::function<void(const TuneTrial&)>& report) {
  Course course(context, options);
  TuneResult result;
  result.start = result.best = default_tuning(context.device());
  const auto measure = [&](const std::string& axis, const std::vector<DeviceTuning>& candidates) {
    std::vector<TuneTrial> trials = race(course, axis, candidates, options.repeat);
    for (const TuneTrial& trial : trials) {
      if (report) report(trial);
      result.trials.push_back(trial);
    }
    return trials;
  };
  for (int round = 0; round < kRounds; ++round) {
    const DeviceTuning before = result.best;
    for (const std::string& axis : options.axes) {
      result.best =
          winner(measure(axis, tune_candidates(axis, result.best, context.device())), result.best);
    }
    if (result.best == before) break;
  }
  if (result.best != result.start) {
    const std::vector<TuneTrial> trials = measure("default", {result.start, result.best});
    result.best = winner(trials, result.start);
    const TuneTrial* first = find_trial(trials, result.start);
    const TuneTrial* last = find_trial(trials, result.best);
    if (first != nullptr && last != nullptr) result.speedup = first->seconds / last->seconds;
  }
  context.set_tuning(result.best);
  return result;
}

}  // namespace raysplats
