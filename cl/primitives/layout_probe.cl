// SPDX-License-Identifier: Apache-2.0
// Writes the size of every shared record as this device's compiler sees it; one work-item.
#include "shared/layout.h"

__kernel void layout_probe(__global uint* sizes) {
  sizes[0] = sizeof(RsAabb);
  sizes[1] = sizeof(RsBvhNode);
  sizes[2] = sizeof(RsLine);
  sizes[3] = sizeof(RsViewBounds);
  sizes[4] = sizeof(RsCamera);
  sizes[5] = sizeof(RsAdamGroup);
}
