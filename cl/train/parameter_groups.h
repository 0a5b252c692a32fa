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

#endif
