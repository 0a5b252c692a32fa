// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

namespace raysplats {

/// Every file below cl/ by its path there ("bvh/curve.cl"), embedded at build time.
const std::map<std::string, std::string>& kernel_sources();

}  // namespace raysplats
