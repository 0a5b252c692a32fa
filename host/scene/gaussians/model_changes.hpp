// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/mat4x4.hpp>

#include "raysplats/model_changes.hpp"

namespace raysplats {

/// Where the changes move points to: `up`, scale, rotation and translation, one after the other.
/// Throws as changed().
glm::dmat4 movement(const ModelChanges& changes);

}  // namespace raysplats
