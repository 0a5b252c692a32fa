// SPDX-License-Identifier: Apache-2.0
#include "bench/processor_time.hpp"

#include <algorithm>
#include <ctime>

namespace raysplats {
namespace {

double process_seconds() {
  std::timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

ProcessorTime::ProcessorTime(const Context& context)
    : units_(context.device().type == DeviceType::kCpu ? context.device().compute_units : 0.0),
      begin_(process_seconds()) {}

double ProcessorTime::share(double seconds) const {
  if (!(units_ > 0) || !(seconds > 0)) return 1.0;
  return std::min(1.0, (process_seconds() - begin_) / (units_ * seconds));
}

}  // namespace raysplats
