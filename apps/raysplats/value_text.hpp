// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "raysplats/device.hpp"

namespace raysplats::cli {

/// The items of a list in any spelling (list_items()). Throws UsageError when it is none.
std::vector<std::string> parts_of(const std::string& text);
/// The same, each of which must be one of `known`; UsageError for others and for none.
std::vector<std::string> names_of(const std::string& option,
                                  const std::string& text,
                                  const std::vector<std::string>& known);
/// A number of Gaussians: "100k", "1.5M" or plain digits.
std::size_t parse_count(const std::string& option, const std::string& text);
/// Seconds of a duration: "90", "90s", "1.5m" or "2h".
double parse_duration(const std::string& option, const std::string& text);
/// Width and height of "800x600".
std::pair<int, int> parse_resolution(const std::string& text);

/// "packet width 16, tiles of 32, pending 96, groups of whole tiles".
std::string describe(const DeviceTuning& tuning);

/// "1.5 GiB" and the like.
std::string readable_bytes(std::uint64_t bytes);

}  // namespace raysplats::cli
