// SPDX-License-Identifier: Apache-2.0
// The groups of parameters, for kernels that go over all of them in one launch. A group of
// work-items belongs to one group of parameters, so neighbours touch neighbouring addresses.
#ifndef RS_TRAIN_PARAMETER_GROUPS_H
#define RS_TRAIN_PARAMETER_GROUPS_H

#include "shared/train_layout.h"

// Floats of the SH coefficients of one Gaussian.
#ifndef SH_FLOATS
#define SH_FLOATS 48
#endif

// VISIT(number, name, width, place) for each: its place among the groups, what its arguments are
// called, floats of one Gaussian, and those of the groups before it.
#define RS_EACH_PARAMETER_GROUP(VISIT) \
  VISIT(0, means, 3, 0)                \
  VISIT(1, quaternions, 4, 3)          \
  VISIT(2, scales, 3, 7)               \
  VISIT(3, opacities, 1, 10)           \
  VISIT(RS_SH_GROUP, sh, SH_FLOATS, 11)

// Whether this group of work-items belongs to that group of parameters, and the number of the
// work-item among all that do.
#define rs_works_on(parts, number) \
  (get_group_id(0) >= (parts).first[number] && get_group_id(0) < (parts).first[(number) + 1])
#define rs_item_of(parts, number) \
  ((get_group_id(0) - (parts).first[number]) * (size_t)get_local_size(0) + get_local_id(0))

// A visitor that sets `from` and `to`, the arrays of the group of parameters that this group of
// work-items belongs to (RS_TO(name) is what the kernel calls those of `to`), its work-item's
// number `i` and their number `end`. Arrays are chosen before one is touched: where a compiler
// makes masks of the conditions, it would touch all of them, masked out beyond their ends, which
// takes CPUs hundreds of cycles.
#define RS_CHOOSE_ARRAYS(number, name, width, place) \
  if (rs_works_on(parts, number)) {                  \
    from = name;                                     \
    to = RS_TO(name);                                \
    i = rs_item_of(parts, number);                   \
    end = (size_t)count * width;                     \
  }

#endif
