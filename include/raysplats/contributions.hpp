// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/context.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/mirrors.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// How many views contributions() looks at, at most.
constexpr std::size_t kMostContributionViews = 64;

/// What each Gaussian gives to the pictures of views: the mean over their pixels of its share of
/// the light, alpha times the transmittance before it, as the backward pass adds it up. More
/// views than kMostContributionViews are thinned out evenly, and large pictures made smaller
/// (600 000 pixels). `within` hears the share that is done, several times a second while pictures
/// are traced, and returns false to stop; then there are none. Throws as Tracer, and UsageError
/// without a camera.
std::vector<double> contributions(Context& context,
                                  const Gaussians& model,
                                  std::span<const Camera> cameras,
                                  TraceOptions trace,
                                  const Mirrors& mirrors = {},
                                  const std::function<bool(double share)>& within = {});

}  // namespace raysplats
