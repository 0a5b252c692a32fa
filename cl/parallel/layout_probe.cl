// SPDX-License-Identifier: Apache-2.0
// Writes the layout of every shared record as this device's compiler sees it: per record its size,
// then the offset of each field in order of declaration. Launch: one work-item; returns how many
// words it wrote in layout[0].
#include "shared/records.h"

#define RS_PUT_SIZE(type) layout[next++] = (uint)sizeof(type);
#define RS_PUT_OFFSET(type, field) layout[next++] = (uint) __builtin_offsetof(type, field);

__kernel void layout_probe(__global uint* layout) {
  uint next = 1;
  RS_RECORDS(RS_PUT_SIZE, RS_PUT_OFFSET)
  layout[0] = next;
}
