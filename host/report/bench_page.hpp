// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "bench/report.hpp"

namespace raysplats {

/// A page about a benchmark: device and limits, every row with the share of those limits that it
/// reaches, and how times grow with the number of Gaussians where there are several. One file
/// without script or anything from elsewhere; well-formed XML.
std::string bench_page(const BenchReport& report);

}  // namespace raysplats
