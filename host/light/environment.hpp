// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/scene.hpp"
#include "shared/light_layout.h"

namespace raysplats {

/// The record that kernels read: axes of the picture, and the light of the environment on a surface
/// as nine coefficients of its normal (Ramamoorthi and Hanrahan 2001). Throws UsageError for an
/// `up` of length zero and for a picture that has not three channels.
RsEnvironment environment_record(const Environment& environment);

/// Whether its sky is seen: where there is no picture.
bool shows_sky(const Environment& environment);
/// The same with its sky, where it is seen, as a picture of kSkyHeight rows and twice as many
/// columns, which is within 1/100 of it at the poles of `up` and far closer elsewhere. Throws
/// UsageError as Sky and environment_record().
Environment with_drawn_sky(const Environment& environment);
constexpr int kSkyHeight = 512;

}  // namespace raysplats
