// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// What is transparent in a data set's photos, told by a few of them, evenly spread.
enum class Transparency {
  kNone,    ///< nothing, or in few of them
  kBorder,  ///< the same small part of all: what a lens or its correction does not fill
  kHoles,   ///< parts within them, as of a person who was cut away
  kCutOut,  ///< what lies around a body that was cut out
};

struct TransparentPhotos {
  Transparency kind = Transparency::kNone;
  std::size_t count = 0;  ///< of photos with something transparent
  bool exact = true;      ///< else told by the share of those that were looked at
};

/// Decodes at most five photos whose files can be transparent, or twenty where these disagree; what
/// cannot be read counts as opaque.
TransparentPhotos transparency(std::span<const View> views);

}  // namespace raysplats::io
