// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "device/argument_type.hpp"
#include "raysplats/rays.hpp"
#include "shared/ray_layout.h"

namespace raysplats {

// Rays and results go to kernels as they are.
static_assert(sizeof(Ray) == sizeof(RsRay) && offsetof(Ray, t_min) == offsetof(RsRay, t_min) &&
              offsetof(Ray, direction) == offsetof(RsRay, direction) &&
              offsetof(Ray, t_max) == offsetof(RsRay, t_max));
static_assert(sizeof(RayResult) == sizeof(RsRayResult) &&
              offsetof(RayResult, alpha) == offsetof(RsRayResult, alpha) &&
              offsetof(RayResult, expected_depth) == offsetof(RsRayResult, expected_depth) &&
              offsetof(RayResult, median_depth) == offsetof(RsRayResult, median_depth) &&
              offsetof(RayResult, hits) == offsetof(RsRayResult, hits) &&
              offsetof(RayResult, capped) == offsetof(RsRayResult, capped));

namespace detail {

template <>
struct ArgumentNumbersOf<Ray> : ArgumentNumbersOf<RsRay> {};
template <>
struct ArgumentNumbersOf<RayResult> : ArgumentNumbersOf<RsRayResult> {};

}  // namespace detail
}  // namespace raysplats
