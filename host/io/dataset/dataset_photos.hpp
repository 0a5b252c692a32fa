// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Throws UsageError unless every area is a box within the picture.
void check_areas(std::span<const PhotoArea> areas);

/// Left, top, right and bottom of each, as the option ignore-areas takes them.
std::string text_of(std::span<const PhotoArea> areas);

/// Finds what photos that are decoded tell of all of them: what their alpha means, what masks and
/// borders leave out, and gives views what options leave out of all. Warns of what they do not say.
/// Throws UsageError where areas of cut-out photos are to be left out.
void look_at_photos(Dataset& dataset, const DatasetOptions& options);

}  // namespace raysplats::io
