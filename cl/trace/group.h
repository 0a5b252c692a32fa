// SPDX-License-Identifier: Apache-2.0
// A packet whose rays are the work-items of one work-group: the form for devices that run many
// work-items at once. GROUP work-items trace a block of GROUP pixels together, all on the same way
// through the code; what they share lies in local memory. Barriers and local atomics of OpenCL 1.2
// are all it takes; where a group is no larger than a hardware thread, compilers drop most of both.
// No barrier depends on a condition but that of a loop, and no way leaves a loop between two:
// implementations that make loops over work-items double what follows a conditional barrier.
//   SUBGROUP 1: the group is a single subgroup, whose functions (cl_khr_subgroups) take the place
//               of barriers and local atomics. The host asks the compiled kernel whether it is.
//   SUBGROUP 2: the same, demanded of compilers that choose the size themselves.
#ifndef RS_TRACE_GROUP_H
#define RS_TRACE_GROUP_H

#ifndef LANES
#define LANES 1
#endif
#include "parallel/wave.h"
#include "trace/packet.h"

#if LANES != 1
#error "Packets of work-items hold one ray per work-item"
#endif

#ifndef GROUP
#define GROUP 32
#endif
#define RS_GROUP_WIDTH (GROUP >= 32 ? 8 : 4)
#define RS_GROUP_HEIGHT (GROUP / RS_GROUP_WIDTH)
#ifndef SUBGROUP
#define SUBGROUP 0
#endif
#if SUBGROUP
#ifdef cl_khr_subgroups
#pragma OPENCL EXTENSION cl_khr_subgroups : enable
#endif
#ifdef cl_khr_subgroup_ballot
#pragma OPENCL EXTENSION cl_khr_subgroup_ballot : enable
#endif
#endif
// Attributes of a kernel whose groups have this size, whatever the host says, and waves of 16
// work-items where a group is not one subgroup.
#if SUBGROUP == 2 && defined(cl_intel_required_subgroup_size) && GROUP <= 32
#define RS_GROUP_KERNEL                              \
  __attribute__((reqd_work_group_size(GROUP, 1, 1))) \
  __attribute__((intel_reqd_sub_group_size(GROUP)))
#elif SUBGROUP || GROUP < 16
#define RS_GROUP_KERNEL __attribute__((reqd_work_group_size(GROUP, 1, 1)))
#else
#define RS_GROUP_KERNEL RS_WAVE_OF_16 __attribute__((reqd_work_group_size(GROUP, 1, 1)))
#endif

// Packets are traced by two launches, one after the other. The first keeps few rows of hits, so
// that many groups are resident, and leaves packets that need more to the second (CROWDED 1), which
// keeps twice as many and skips what is done.
#ifndef CROWDED
#define CROWDED 0
#endif
// Rows of hits that are open at once, and sets of them: a bit each.
#if CROWDED
#define OPEN 64
typedef ulong RowSet;
#else
#define OPEN 32
typedef uint RowSet;
#endif
#define RS_SLOT(slot) ((RowSet)1 << (slot))
uint rs_first_slot(const RowSet rows) { return 8 * sizeof(RowSet) - 1 - (uint)clz(rows & -rows); }
// The first of them lie in local memory, a column per work-item; the others, which few packets
// need, in private memory: it is the local memory of a group that decides how many are resident.
#ifndef OPEN_LOCAL
#define OPEN_LOCAL 16
#endif
#define RS_OPEN_OWN (OPEN > OPEN_LOCAL ? OPEN - OPEN_LOCAL : 1)

// A number that every work-item keeps per open row.
typedef __local float (*RowColumns)[GROUP];

float rs_row_get(const RowColumns columns, const float* own, const uint slot, const int lane) {
  return OPEN <= OPEN_LOCAL || slot < OPEN_LOCAL ? columns[slot][lane] : own[slot - OPEN_LOCAL];
}

void rs_row_set(
    const RowColumns columns, float* own, const uint slot, const int lane, const float value) {
  if (OPEN <= OPEN_LOCAL || slot < OPEN_LOCAL) {
    columns[slot][lane] = value;
  } else {
    own[slot - OPEN_LOCAL] = value;
  }
}

// Attribute of functions that are called in one place: what they keep for a ray stays in registers
// only where they are inlined, which not every compiler does with large ones. (RS_CALLS: as in
// lbvh_node.h.)
#ifdef RS_CALLS
#define RS_GROUP_INLINE
#else
#define RS_GROUP_INLINE __attribute__((always_inline))
#endif

#if SUBGROUP
#define RS_GROUP_BARRIER(fence) sub_group_barrier(fence)
#define rs_group_lane() ((int)get_sub_group_local_id())
#else
#define RS_GROUP_BARRIER(fence) barrier(fence)
#define rs_group_lane() ((int)get_local_id(0))
#endif
#define rs_group_barrier() RS_GROUP_BARRIER(CLK_LOCAL_MEM_FENCE)

// One bit per work-item whose flag is set, work-item 0 lowest. `words`: two words of local memory,
// which subgroups leave alone.
ulong rs_group_bits(__local uint* words, const int lane, const bool flag) {
#if SUBGROUP && defined(cl_khr_subgroup_ballot)
  (void)words;
  (void)lane;
  const uint4 bits = sub_group_ballot(flag);
  return (ulong)bits.y << 32 | bits.x;
#elif SUBGROUP && GROUP <= 32
  (void)words;
  return sub_group_reduce_add(flag ? 1u << lane : 0u);
#elif SUBGROUP
  (void)words;
  return sub_group_reduce_add(flag ? 1ul << lane : 0ul);
#else
  rs_group_barrier();
  if (lane < 2) words[lane] = 0;
  rs_group_barrier();
  if (flag) atomic_or(words + (lane >> 5), 1u << (lane & 31));
  rs_group_barrier();
  return (ulong)words[1] << 32 | words[0];
#endif
}

// Columns and rows of groups that cover a picture.
uint rs_group_number(const int width, const int px, const int py) {
  const uint across = (width + RS_GROUP_WIDTH - 1) / RS_GROUP_WIDTH;
  return (py / RS_GROUP_HEIGHT) * across + px / RS_GROUP_WIDTH;
}

#endif
