// SPDX-License-Identifier: Apache-2.0
// On GPUs a work-item has one Gaussian, whose floats lie together: its neighbour's are a row away.
// The work-items of a group therefore fetch and store the rows of their Gaussians together, through
// local memory, at most RS_COLUMNS columns at a time: neighbours touch neighbouring addresses, and
// no work-item keeps a long row in its private memory. GROUP is the number of work-items, 0 on
// CPUs, where vectors do this (gaussian_lanes.h).
#ifndef RS_TRACE_STAGED_ROWS_H
#define RS_TRACE_STAGED_ROWS_H

#ifndef GROUP
#define GROUP 0
#endif

#if GROUP
// Odd, so that the same column of all rows lies on all banks, and so many that with `present` a row
// takes 64 bytes: 16 groups of 64 fit 64 kB, four waves a SIMD of gfx9.
#define RS_COLUMNS 15
// SH coefficients at a time: whole colours. Kernels write a call for each of up to seven such
// stages: in a loop their column would be no constant, and what it indexes would leave the
// registers.
#define RS_STAGE 12
#if defined(SH_COEFFICIENTS) && 3 * SH_COEFFICIENTS > 7 * RS_STAGE
#error "seven stages do not hold all SH coefficients"
#endif

typedef struct {
  float rows[GROUP][RS_COLUMNS];
  uint present[GROUP];  // rows that are fetched or stored
} StagedRows;

// Columns column .. column + count of the group's rows, which begin at p and are `stride` apart.
// All work-items call it. Rows that are not present keep what they held.
void stage_fetch(__global const float* p,
                 const uint stride,
                 const uint column,
                 const uint count,
                 __local StagedRows* staged) {
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint k = get_local_id(0); k < GROUP * count; k += GROUP) {
    const uint row = k / count, c = k % count;
    if (staged->present[row]) staged->rows[row][c] = p[(size_t)row * stride + column + c];
  }
  barrier(CLK_LOCAL_MEM_FENCE);
}

// Writes the columns from .. from + count of what is staged to column, column + 1, ... of the
// group's rows; with `add` adds them there.
void stage_store(__local StagedRows* staged,
                 const uint from,
                 const uint count,
                 __global float* p,
                 const uint stride,
                 const uint column,
                 const int add) {
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint k = get_local_id(0); k < GROUP * count; k += GROUP) {
    const uint row = k / count, c = k % count;
    __global float* to = p + (size_t)row * stride + column + c;
    const float value = staged->rows[row][from + c];
    if (staged->present[row]) *to = add ? *to + value : value;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
}
#endif

#endif
