// SPDX-License-Identifier: Apache-2.0
// Exclusive prefix sum over one work-group, which stops at 2^32 - 1 (Hillis and Steele 1986,
// log2(RS_GROUP) steps). Every work-item of the group must call it; RS_GROUP is a power of two and
// `scratch` holds RS_GROUP elements.
#ifndef RS_PRIMITIVES_GROUP_SCAN_H
#define RS_PRIMITIVES_GROUP_SCAN_H

#ifndef RS_GROUP
#define RS_GROUP 1
#endif

#if RS_GROUP > 1
inline uint group_scan(uint value, __local uint* scratch, uint* total) {
  const uint lane = get_local_id(0);
  scratch[lane] = value;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint step = 1; step < RS_GROUP; step <<= 1) {
    const uint before = lane >= step ? scratch[lane - step] : 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    scratch[lane] = add_sat(scratch[lane], before);
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  const uint exclusive = lane > 0 ? scratch[lane - 1] : 0;
  *total = scratch[RS_GROUP - 1];
  barrier(CLK_LOCAL_MEM_FENCE);  // scratch may be written again
  return exclusive;
}
#endif

#endif
