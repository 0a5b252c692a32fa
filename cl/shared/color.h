// SPDX-License-Identifier: Apache-2.0
// Colours lie between 0 and this bound, NaN counts as 0: sums of colours with weights of at most 1
// in all stay finite whatever the spherical harmonics are.
#ifndef RS_SHARED_COLOR_H
#define RS_SHARED_COLOR_H

#define RS_MAX_COLOR 1e30f

// Whether a gradient passes to a colour. Nothing passes where it is clamped at 0; with
// RAISE_CLAMPED what raises it does, so that a Gaussian that became too dark once is not lost.
#ifndef RAISE_CLAMPED
#define RAISE_CLAMPED 0
#endif
#if RAISE_CLAMPED
#define RS_COLOR_PASSES(color, gradient) ((color) > 0.0f | (gradient) < 0.0f)
#else
#define RS_COLOR_PASSES(color, gradient) ((color) > 0.0f)
#endif

#endif
