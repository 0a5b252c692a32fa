// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "core/option_table.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// What tracing is told: the same on every command line, in [trace] of scene files and in training
/// configurations. All of TraceOptions but depth, which commands choose themselves, deterministic
/// and the background.
void add_trace_rows(OptionTable& table, TraceOptions& options);
/// The colour behind the Gaussians.
void add_background_row(OptionTable& table, TraceOptions& options);

/// "auto", "vector" or "group".
std::string packet_shape_name(PacketForm form);
/// Throws UsageError for a width that packets of that form cannot have.
void check_packet_width(const TraceOptions& options);

/// Options of tracing that a user gave, to go over others.
class TraceSettings {
 public:
  /// Throws UsageError for a name that is none of the rows above, and for values that it does not
  /// accept.
  void set(const std::string& name, const std::vector<std::string>& values);
  bool has(const std::string& name) const;
  /// A background that was given takes the place of a sky.
  TraceOptions over(TraceOptions base) const;

 private:
  struct Given {
    std::string name;
    std::vector<std::string> values;
  };
  std::vector<Given> given_;
};

/// The rows that TraceSettings know, bound to `options`.
std::vector<OptionRow> trace_rows(TraceOptions& options);

}  // namespace raysplats
