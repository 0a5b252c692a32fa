// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Finds what photos that are decoded tell of all of them: what their alpha means, what masks and
/// borders leave out. Warns of what they do not say.
void look_at_photos(Dataset& dataset, const DatasetOptions& options);

}  // namespace raysplats::io
