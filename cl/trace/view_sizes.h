// SPDX-License-Identifier: Apache-2.0
// Words in which the device tells what a view needed. Read by kernels and host.
#ifndef RS_TRACE_VIEW_SIZES_H
#define RS_TRACE_VIEW_SIZES_H

// Of one view: chunks that its hit streams want, rays that the cap on hits stopped, hits and
// candidates (64 bits each, the low word first).
#define RS_COUNT_CHUNKS 0
#define RS_COUNT_CAPPED 1
#define RS_COUNT_HITS 2
#define RS_COUNT_CANDIDATES 4
#define RS_COUNT_WORDS 6

// Where a hit stream ends that has no rows.
#define RS_NO_CHUNK 0xffffffffu

#endif
