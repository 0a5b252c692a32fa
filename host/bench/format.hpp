// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include "bench/report.hpp"

namespace raysplats {

/// Seconds as a number of milliseconds with three or four digits.
std::string format_milliseconds(double seconds);

/// What a row does a second in its unit number `index`, as "12.3 Mrays/s"; "-" without such a unit.
std::string format_rate(const BenchRow& row, std::size_t index);

}  // namespace raysplats
