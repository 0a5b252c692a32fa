// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/number_text.hpp"

namespace raysplats {

/// A number that users set: its name and range, wherever it is set.
struct NumberKey {
  const char* name;
  bool whole;
  double low;
  double high;
  const char* help;

  bool accepts(double value) const { return value >= low && value <= high; }
};

/// What tracing is told by numbers, the same on the command line (with "--"), in [trace] of scene
/// files and in training configurations.
namespace trace_keys {

constexpr NumberKey kQuantile{"quantile", false, 0.01, 100,
                              "squared radius of the ellipsoids in standard deviations (chi^2(3))"};
constexpr NumberKey kMinTransmittance{"min-transmittance", false, 0, 0.5,
                                      "a ray stops below this transmittance"};
constexpr NumberKey kMaxHits{"max-hits", true, 1, 1e6,
                             "a ray stops after so many hits; rays that do are reported"};
constexpr NumberKey kNear{"near", false, 0, kNoBound,
                          "Gaussians nearer to the camera plane are skipped; 0 = off"};
constexpr NumberKey kPacketWidth{"packet-width", true, 0, 16,
                                 "rays per work-item: 1, 2, 4, 8 or 16; 0 = fit to the device"};
constexpr NumberKey kMemoryBudget{"memory-budget", true, 1, 1e9,
                                  "MiB for hit lists; above it they are computed again"};
/// Of every channel.
constexpr NumberKey kBackground{"background", false, 0, 1, "colour behind the Gaussians"};

}  // namespace trace_keys
}  // namespace raysplats
