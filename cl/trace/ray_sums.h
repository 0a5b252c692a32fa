// SPDX-License-Identifier: Apache-2.0
// What ray_backward sums per Gaussian over all rays, RS_RAY_SUMS floats, with v the residual of a
// ray in the space that M = S^-1 R^T whitens and g = dL/d(delta^2):
//   0..2    sum of 2 g v, which the mean receives through -M^T
//   3..8    sum of g v v^T: xx xy xz yy yz zz. Whitened, so that nothing cancels for thin Gaussians
//           and scale and rotation follow directly.
//   9       alpha times dL/dalpha: dL/d(logit) divided by 1 - opacity
//   10      lengths of the rays' gradients on the screen, the densification signal of AbsGS (Ye et
//           al. 2024)
//   11      by how much the rays that meet it blend more than LEAST_WEIGHT of it
//   12..14  SH degree 0: dL/dcolour. Above: dL/dmean through the direction of the colour
//   16..    SH degree above 0: dL/dcolour times basis, all functions of red, then green, then blue
#ifndef RS_TRACE_RAY_SUMS_H
#define RS_TRACE_RAY_SUMS_H

#include "shared/layout.h"

#ifndef SH_DEGREE
#define SH_DEGREE 0
#endif
#define RS_RAY_FUNCTIONS ((SH_DEGREE + 1) * (SH_DEGREE + 1))
#define RS_RAY_SH 16
#if SH_DEGREE == 0
#define RS_RAY_SUMS 16
#else
#define RS_RAY_SUMS ((RS_RAY_SH + 3 * RS_RAY_FUNCTIONS + 15) / 16 * 16)
#endif

#endif
