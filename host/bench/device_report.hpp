// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "bench/bench.hpp"
#include "bench/card_forecast.hpp"
#include "bench/self_test.hpp"
#include "device/context.hpp"

namespace raysplats {

/// What the owner of a device sends: whether it computes as it should, and how fast.
struct DeviceReport {
  /// Frames or training iterations per second on one generated scene.
  struct Speed {
    std::string scene;
    std::size_t size = 0;
    int width = 0;
    int height = 0;
    double per_second = 0;
  };

  /// What a model of speed says of a generated scene on cards(), from the work that kernels of
  /// their form do: to be held against the rows of a card that it is about.
  struct Model {
    std::string scene;
    std::size_t size = 0;
    int width = 0;
    int height = 0;
    CardForecast cards;
  };

  DeviceInfo device;
  std::vector<SelfTestCheck> checks;
  std::vector<BenchReport> runs;      ///< one per number of Gaussians and resolution
  std::vector<Speed> frames;          ///< of rows `view`
  std::vector<Speed> iterations;      ///< of rows `iteration`
  std::vector<Model> models;          ///< of the runs at options' resolution
  std::vector<std::string> left_out;  ///< what, and why
  std::size_t failed = 0;             ///< rows that are left out because they failed
  double compile_seconds = 0;
  double seconds = 0;  ///< of the whole

  bool passed() const;
};

/// Self-test, then all rows at options' resolution and views and iterations at 1600x1064, for every
/// scene and size from the smallest on. What would by the sizes before take more than
/// `most_seconds` in all is left out, and so are rows that have not begun by then. What the device
/// or a lack of memory makes fail is left out too, with the error, and the rest is measured. Needs
/// a context with keep_launches; uses no network.
DeviceReport make_device_report(Context& context,
                                const BenchOptions& options,
                                double most_seconds = 450.0);

/// Fixed-width text, and the same as JSON with all that was measured.
std::string device_report_text(const DeviceReport& report);
std::string device_report_json(const DeviceReport& report);

}  // namespace raysplats
