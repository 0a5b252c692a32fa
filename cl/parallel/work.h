// SPDX-License-Identifier: Apache-2.0
// What the primitives must at least do, counted by hand per element: bytes that have to move when
// nothing is read twice, and arithmetic operations. Read by the host's benchmarks.
#ifndef RS_PRIMITIVES_WORK_H
#define RS_PRIMITIVES_WORK_H

// One 8-bit pass over a 32-bit pair: key for the count (4), pair read (8) and written (8).
#define RS_WORK_SORT_PASS_BYTES 20

#endif
