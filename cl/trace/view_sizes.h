// SPDX-License-Identifier: Apache-2.0
// Words in which the device tells what a view needed. Read by kernels and host.
#ifndef RS_TRACE_VIEW_SIZES_H
#define RS_TRACE_VIEW_SIZES_H

// Words that count for one view: chunks that its hit streams want, rays that the cap on hits
// stopped, hits and candidates (64 bits each, the low word first).
#define RS_COUNT_CHUNKS 0
#define RS_COUNT_CAPPED 1
#define RS_COUNT_HITS 2
#define RS_COUNT_CANDIDATES 4
#define RS_COUNT_WORDS 6
// Behind them, where a view is traced by kernels that count their work (work_tally.h), 64 bits
// each: vectors of boxes tested against a packet (a box per ray in groups), candidates tested
// against the rays of a packet, rows of Gaussians that some ray hits, rows opened, open rows that
// these were compared with, rounds of candidates, rows passed while waiting rows are put in order
// (pairs of rows in groups), open rows that the backward pass compares rows with.
#define RS_TALLY_BOXES 0
#define RS_TALLY_TESTED 1
#define RS_TALLY_FOUND 2
#define RS_TALLY_OPENED 3
#define RS_TALLY_COMPARED 4
#define RS_TALLY_ROUNDS 5
#define RS_TALLY_ORDERED 6
#define RS_TALLY_WINDOWS 7
#define RS_TALLIES 8

// Where a hit stream ends that has no rows.
#define RS_NO_CHUNK 0xffffffffu

#endif
