// SPDX-License-Identifier: Apache-2.0
#include "scene/options/trace_option_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <utility>

#include "raysplats/error.hpp"
#include "util/mebibytes.hpp"

namespace raysplats {
namespace {

const std::vector<std::pair<std::string, PacketShape>>& packet_shapes() {
  static const std::vector<std::pair<std::string, PacketShape>> shapes{
      {"auto", PacketShape::kAuto},
      {"vector", PacketShape::kVector},
      {"group", PacketShape::kGroup},
      {"subgroup", PacketShape::kSubgroup}};
  return shapes;
}

const std::vector<std::pair<std::string, HitOrder>>& hit_orders() {
  static const std::vector<std::pair<std::string, HitOrder>> orders{{"entry", HitOrder::kEntry},
                                                                    {"peak", HitOrder::kPeak}};
  return orders;
}

template <class Value>
std::string name_of(const std::vector<std::pair<std::string, Value>>& names, Value value) {
  for (const auto& [name, each] : names) {
    if (each == value) return name;
  }
  return "";
}

}  // namespace

std::string hit_order_name(HitOrder order) { return name_of(hit_orders(), order); }

std::optional<HitOrder> hit_order_of(const std::string& name) {
  for (const auto& [each, order] : hit_orders()) {
    if (each == name) return order;
  }
  return std::nullopt;
}

std::string packet_shape_name(PacketShape shape) { return name_of(packet_shapes(), shape); }

void check_packet_width(const TraceOptions& options) {
  const int width = options.packet_width;
  if (width == 0) return;
  const int low =
      options.packet_shape == PacketShape::kGroup || options.packet_shape == PacketShape::kSubgroup
          ? 8
          : 1;
  const int high = options.packet_shape == PacketShape::kVector ? 16 : 64;
  if ((width & (width - 1)) == 0 && width >= low && width <= high) return;
  throw UsageError(
      fmt::format("The option 'packet-width' is 0, 1, 2, 4, 8 or 16 with 'packet-shape' vector, "
                  "0, 8, 16, 32 or 64 with group and subgroup, not {}",
                  width));
}

void check_trace_options(TraceOptions options) {
  OptionTable table;
  add_trace_options(table, options);
  check_values(table.take());
}

float stopping_transmittance(const TraceOptions& options) {
  return std::max(options.min_transmittance, std::numeric_limits<float>::min());
}

void add_trace_options(OptionTable& t, TraceOptions& o) {
  t.choice<HitOrder>("hit-order", o.hit_order, hit_orders(),
                     "depth that orders a ray's hits: entry (near side of the ellipsoid, the "
                     "paper) or peak (strongest response)");
  t.number("quantile", o.quantile, 0.01, 100,
           "squared radius of the ellipsoids in standard deviations (chi^2(3))");
  t.number("min-transmittance", o.min_transmittance, 0, 0.5,
           "a ray stops below this transmittance; 0 = only behind what is opaque");
  t.number("max-hits", o.max_hits, 1, 1e6,
           "a ray stops after so many hits; rays that do are reported");
  t.flag("adaptive-radius", o.adaptive_radius,
         "shrink the ellipsoids to where they contribute at least 1/255");
  t.number("near", o.near_depth, 0, kNoBound,
           "Gaussians nearer to the camera plane are skipped; 0 = off");
  t.number("view-footprint", o.view_footprint, 0, 10,
           "pictures show no axis of a Gaussian thinner than this share of their pixels, and "
           "thinner ones fainter, as pixels see them on average; training ray by ray is without; "
           "0 = off");
  t.choice<Traversal>(
      "traversal", o.traversal,
      {{"auto", Traversal::kAuto}, {"tiles", Traversal::kTiles}, {"bvh", Traversal::kBvh}},
      "how camera rays find Gaussians: tiles (packets share the list of their tile), bvh (each ray "
      "walks the hierarchy, the paper) or auto (as 'raysplats tune' found, else tiles); scenes "
      "with mirrors and orthographic cameras need rays one by one");
  t.choice<PacketShape>(
      "packet-shape", o.packet_shape, packet_shapes(),
      "what a packet of camera rays is: vector (the lanes of one work-item), group (the work-items "
      "of a work-group), subgroup (those of a work-group that is one subgroup) or auto (as "
      "'raysplats tune' found, else vectors on CPUs, and elsewhere subgroups where the compiler "
      "makes them that large, or groups)");
  t.number("packet-width", o.packet_width, 0, 64,
           "rays of a packet: 1, 2, 4, 8 or 16, in a group also 32 or 64; 0 = fit to the device");
  t.add(
      "memory-budget",
      "MiB for hit lists; above it they are computed again; 0 = a quarter of the device's memory, "
      "from 1024 to 4096 and no more than two of its largest buffers",
      [&o](const OptionTable::Values& values) {
        const std::string& text = option_value("memory-budget", values);
        const auto mib = option_number<std::int64_t>("memory-budget", text, 0, 1e9);
        o.memory_budget = static_cast<std::size_t>(mib) * kMiB;
      },
      [&o] { return std::to_string(o.memory_budget / kMiB); });
  t.choice<GradientSum>(
      "gradient-sum", o.gradient_sum,
      {{"auto", GradientSum::kAuto},
       {"copies", GradientSum::kCopies},
       {"exact", GradientSum::kExact},
       {"atomic", GradientSum::kAtomic},
       {"swap", GradientSum::kSwap}},
      "how the gradients of rays are added: private copies (CPUs), exact (long integers, the same "
      "bits in any order), atomic (floats, not deterministic) or swap (as atomic, without the "
      "device's own float additions); auto = copies on CPUs, else atomic, or exact with "
      "deterministic");
  t.number("launch-budget-ms", o.launch_budget_ms, -1, 1e9,
           "a view is traced in bands of rows that take about this long each, so that watchdogs of "
           "displays do not stop them; 0 = no bound, -1 = none on CPUs and 100 elsewhere");
}

void add_background_option(OptionTable& table, TraceOptions& options) {
  table.color("background", options.background,
              "colour behind the Gaussians, 0 to 1 each; one number is a grey");
}

std::vector<OptionRow> trace_option_rows(TraceOptions& options) {
  OptionTable table;
  add_trace_options(table, options);
  add_background_option(table, options);
  return table.take();
}

TraceOptions TraceSettings::over(TraceOptions base) const {
  TraceOptions out = GivenOptions::over(std::move(base));
  if (has("background")) out.sky.clear();
  return out;
}

}  // namespace raysplats
