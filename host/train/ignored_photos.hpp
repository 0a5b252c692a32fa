// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/dataset.hpp"

namespace raysplats {

/// The data set without the views of which masks leave nothing, as segmentation gives them for
/// photos that do not show what it looks for: a step would learn nothing of them, and there is
/// nothing to measure. A warning counts them. Decodes every mask that ignores once, on all cores:
/// less than a pass over the photos. Throws DataError for a mask that cannot be read, and where no
/// training view is left.
Dataset without_ignored_photos(Dataset dataset);

}  // namespace raysplats
