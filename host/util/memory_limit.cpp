// SPDX-License-Identifier: Apache-2.0
#include "util/memory_limit.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

namespace raysplats {

std::string memory_limit_remark() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return "";
  return fmt::format("; this process may take {} MiB of memory (ulimit -v)", limit.rlim_cur >> 20);
}

}  // namespace raysplats
