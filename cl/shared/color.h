// SPDX-License-Identifier: Apache-2.0
// Colours lie between 0 and this bound, NaN counts as 0: sums of colours with weights of at most 1
// in all stay finite whatever the spherical harmonics are.
#ifndef RS_SHARED_COLOR_H
#define RS_SHARED_COLOR_H

#define RS_MAX_COLOR 1e30f

#endif
