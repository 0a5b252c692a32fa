// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// What is transparent in a data set's photos, told by a few of them, evenly spread.
enum class Transparency {
  kNone,    ///< nothing, or in few of them
  kBorder,  ///< the same small part of all: what a lens or its correction does not fill
  kCutOut,  ///< what lies around a body that was cut out
};

/// Opens at most five photos whose format can be transparent; what cannot be read counts as opaque.
Transparency transparency(std::span<const View> views);

}  // namespace raysplats::io
