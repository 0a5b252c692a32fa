// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "device/context.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// What can be varied: "packet-width", "tile", "pending" and "group".
const std::vector<std::string>& tune_axes();

struct TuneOptions {
  std::vector<std::string> axes = tune_axes();
  std::string scene = "random";  ///< of bench_scene_names()
  std::size_t size = 100000;     ///< Gaussians
  int width = 512;
  int height = 512;
  std::uint64_t seed = 1;
  int repeat = 5;
  TraceOptions trace;  ///< packet_width is searched, not taken
};

/// A choice that was measured.
struct TuneTrial {
  std::string axis;  ///< what was varied, or "default" for the last comparison
  DeviceTuning tuning;
  double seconds = 0;   ///< least device time of a forward and backward pass; 0 = it does not run
  std::string problem;  ///< why it does not run
};

struct TuneResult {
  DeviceTuning start;  ///< what follows from the device's limits
  DeviceTuning best;
  double speedup = 1;  ///< time of start over time of best, both measured again side by side
  std::vector<TuneTrial> trials;
};

/// What tracing does on the device without a tuning.
DeviceTuning default_tuning(const DeviceInfo& device);

/// The values that are tried for one axis, the others being those of `current`.
std::vector<DeviceTuning> tune_candidates(const std::string& axis,
                                          const DeviceTuning& current,
                                          const DeviceInfo& device);

/// Searches axis by axis, again until nothing changes. The candidates of an axis take turns, so
/// that other load on the machine meets all alike; a candidate must win by more than 2 %. Where the
/// default does as well as the winner, the result is the default. `report` hears of every trial.
/// Changes the context's tuning; needs a context with keep_launches. Throws DeviceError when
/// nothing runs.
TuneResult tune_device(Context& context,
                       const TuneOptions& options,
                       const std::function<void(const TuneTrial&)>& report = {});

}  // namespace raysplats
