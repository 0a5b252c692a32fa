// SPDX-License-Identifier: Apache-2.0
// Exclusive prefix sum over one work-group, which stops at 2^32 - 1: rows of RS_SCAN_ROW values are
// summed by a work-item each, then everybody adds the sums of the rows before its own. Three
// barriers; a scan by doubling takes 2 log2(GROUP). Every work-item of the group must call it;
// GROUP is a power of two and `scratch` holds RS_SCAN_WORDS words.
#ifndef RS_PRIMITIVES_GROUP_SCAN_H
#define RS_PRIMITIVES_GROUP_SCAN_H

#ifndef GROUP
#define GROUP 1
#endif

#if GROUP > 1
#define RS_SCAN_ROW (GROUP < 16 ? GROUP : 16)
#define RS_SCAN_ROWS (GROUP / RS_SCAN_ROW)
// The sum of a row lies behind it, which lets rows begin on different banks.
#define RS_SCAN_STRIDE (RS_SCAN_ROW + 1)
#define RS_SCAN_WORDS (RS_SCAN_ROWS * RS_SCAN_STRIDE)

uint group_scan(uint value, __local uint* scratch, uint* total) {
  const uint lane = get_local_id(0);
  const uint row = lane / RS_SCAN_ROW;
  const uint place = row * RS_SCAN_STRIDE + lane % RS_SCAN_ROW;
  scratch[place] = value;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (lane < RS_SCAN_ROWS) {
    __local uint* values = scratch + lane * RS_SCAN_STRIDE;
    uint sum = 0;
    for (uint i = 0; i < RS_SCAN_ROW; ++i) {
      const uint next = values[i];
      values[i] = sum;
      sum = add_sat(sum, next);
    }
    values[RS_SCAN_ROW] = sum;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  uint before = 0, all = 0;
  for (uint i = 0; i < RS_SCAN_ROWS; ++i) {
    before = i == row ? all : before;
    all = add_sat(all, scratch[i * RS_SCAN_STRIDE + RS_SCAN_ROW]);
  }
  const uint exclusive = add_sat(before, scratch[place]);
  *total = all;
  barrier(CLK_LOCAL_MEM_FENCE);  // scratch may be written again
  return exclusive;
}
#endif

#endif
