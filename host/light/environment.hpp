// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/scene.hpp"
#include "shared/light_layout.h"

namespace raysplats {

/// The record that kernels read: axes of the picture, and the light of the environment on a surface
/// as nine coefficients of its normal (Ramamoorthi and Hanrahan 2001). Throws UsageError for an
/// `up` of length zero and for a picture that has not three channels.
RsEnvironment environment_record(const Environment& environment);

}  // namespace raysplats
