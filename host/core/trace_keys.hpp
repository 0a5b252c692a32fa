// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "base/number_text.hpp"
#include "raysplats/trace_options.hpp"

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
constexpr NumberKey kPacketWidth{
    "packet-width", true, 0, 64,
    "rays of a packet: 1, 2, 4, 8 or 16, in a group also 32 or 64; 0 = "
    "fit to the device"};
constexpr NumberKey kMemoryBudget{"memory-budget", true, 1, 1e9,
                                  "MiB for hit lists; above it they are computed again"};
/// Of every channel.
constexpr NumberKey kBackground{"background", false, 0, 1, "colour behind the Gaussians"};

/// TraceOptions::packet_form by name.
struct PacketFormName {
  const char* name;
  PacketForm form;
};
constexpr const char* kPacketShape = "packet-shape";
constexpr const char* kPacketShapeHelp =
    "what a packet of camera rays is: vector (the lanes of one work-item), group (the work-items "
    "of "
    "a work-group) or auto (as 'raysplats tune' found, else vectors on CPUs and groups elsewhere)";
constexpr std::array<PacketFormName, 3> kPacketShapes{
    {{"auto", PacketForm::kAuto}, {"vector", PacketForm::kVector}, {"group", PacketForm::kGroup}}};

constexpr const char* packet_shape_name(PacketForm form) {
  for (const PacketFormName& each : kPacketShapes) {
    if (each.form == form) return each.name;
  }
  return "";
}

/// Whether packets of that form may have `width` rays; 0 leaves it to the device.
constexpr bool is_packet_width(PacketForm form, int width) {
  if (width == 0) return true;
  const int low = form == PacketForm::kGroup ? 8 : 1;
  const int high = form == PacketForm::kVector ? 16 : 64;
  return (width & (width - 1)) == 0 && width >= low && width <= high;
}

}  // namespace trace_keys
}  // namespace raysplats
