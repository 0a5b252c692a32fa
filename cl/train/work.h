// SPDX-License-Identifier: Apache-2.0
// What a training step must at least do beside tracing, counted by hand: bytes that have to move
// when nothing is read twice, and arithmetic operations (a fused multiply-add counts two; minimum,
// maximum, division, root count one). Read by the host's benchmarks.
#ifndef RS_TRAIN_WORK_H
#define RS_TRAIN_WORK_H

// Value of the loss, per pixel: R, G, B 12 and photo 4 read, u and v of three channels written and
// read (48), derivatives of three channels written (36).
#define RS_WORK_LOSS_VALUE_BYTES 100
// Per channel: pair and pixel term 14, moments along the column 84 and the row 64, SSIM and its
// derivatives 45.
#define RS_WORK_LOSS_VALUE_FLOPS 621

// Gradient of the loss, per pixel: derivatives 36, u and v 24, photo 4 read; gradient 16 written.
#define RS_WORK_LOSS_GRADIENT_BYTES 80
// Per channel: three windows along the column 48 and the row 48, sum 10.
#define RS_WORK_LOSS_GRADIENT_FLOPS 318

// The same in groups, which make the pair anew from image and photo instead of storing it: image
// 12, photo 4, derivatives 36; then gradient 16. Windows along the rows are taken of 26 rows for
// 16.
#define RS_WORK_GROUP_LOSS_VALUE_BYTES 52
#define RS_WORK_GROUP_LOSS_VALUE_FLOPS 848
#define RS_WORK_GROUP_LOSS_GRADIENT_BYTES 68
#define RS_WORK_GROUP_LOSS_GRADIENT_FLOPS 432

// Adam, per parameter: gradient read to choose; parameter, gradient and two moments read; all but
// the gradient written.
#define RS_WORK_ADAM_BYTES 32
// First moment 3, second 4, step 6, check for NaN 2.
#define RS_WORK_ADAM_FLOPS 15

// A sample of the parameters' mean, per parameter: itself and its mean read, the mean written.
#define RS_WORK_MEAN_BYTES 12
#define RS_WORK_MEAN_FLOPS 3

// Density statistics, per Gaussian: screen record 16 read, sums 12 read and written.
#define RS_WORK_STATISTICS_BYTES 40

// Density control, per new Gaussian: source and role read (8); per parameter one read and one write
// (8), 11 parameters beside the SH coefficients.
#define RS_WORK_DENSIFY_BYTES 8
#define RS_WORK_PARAMETER_BYTES 8
#define RS_WORK_PARAMETERS 11

#endif
