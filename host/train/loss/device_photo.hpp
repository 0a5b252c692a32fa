// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "device/buffer.hpp"

namespace raysplats {

/// A photo on the device, as cl/train/photo.h says.
struct DevicePhoto {
  const Buffer<std::uint32_t>& words;
  int planes = 1;         ///< words a pixel: 1 (8 bits a channel), 2 (16 bits) or 4 (floats)
  bool weighted = false;  ///< a plane of weights follows

  std::size_t words_of(std::size_t pixels) const {
    return pixels * (static_cast<std::size_t>(planes) + (weighted ? 1 : 0));
  }
  /// How kernels take its colours and weights: `composite` of cl/train/loss_prepare.cl.
  int composite(bool alpha_is_background) const {
    if (!alpha_is_background) return 0;
    return weighted ? 2 : 1;
  }
};

}  // namespace raysplats
