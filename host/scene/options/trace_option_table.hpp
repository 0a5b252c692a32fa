// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "raysplats/trace_options.hpp"
#include "scene/options/given_options.hpp"
#include "scene/options/option_table.hpp"

namespace raysplats {

/// What tracing is told: the same on every command line, in [trace] of scene files and in training
/// configurations. All of TraceOptions but depth, which commands choose themselves, deterministic
/// and the background.
void add_trace_options(OptionTable& table, TraceOptions& options);
/// The colour behind the Gaussians.
void add_background_option(OptionTable& table, TraceOptions& options);

/// "entry" or "peak".
std::string hit_order_name(HitOrder order);
/// The order of that name; none for other words.
std::optional<HitOrder> hit_order_of(const std::string& name);
/// "auto", "vector", "group" or "subgroup".
std::string packet_shape_name(PacketShape shape);
/// Throws UsageError for a width that packets of that shape cannot have.
void check_packet_width(const TraceOptions& options);

/// Throws UsageError for a value that its row would refuse, as programs may set it.
void check_trace_options(TraceOptions options);

/// Where kernels stop a ray: min-transmittance, or, where that is 0, the least number above 0, so
/// that a ray ends behind what is opaque and nowhere else.
float stopping_transmittance(const TraceOptions& options);

/// All of these rows, bound to `options`.
std::vector<OptionRow> trace_option_rows(TraceOptions& options);

/// Options of tracing that a user gave, to go over others.
class TraceSettings : public GivenOptions<TraceOptions, trace_option_rows> {
 public:
  /// A background that was given takes the place of a sky.
  TraceOptions over(TraceOptions base) const;
};

}  // namespace raysplats
