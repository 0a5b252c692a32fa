// SPDX-License-Identifier: Apache-2.0
// Kernel arguments that come together, declared once. Functions of the host of the same name set
// them in this order (host/trace/camera_tracer_impl.hpp, host/trace/ray_launch.hpp).
#ifndef RS_TRACE_ARGUMENTS_H
#define RS_TRACE_ARGUMENTS_H

#include "shared/ray_layout.h"
#include "shared/trace_layout.h"

// Parameters of all Gaussians, Gaussian-major; scales before their activation, opacities as logits.
#define RS_GAUSSIAN_ARGUMENTS                                                          \
  __global const float *restrict means, __global const float *restrict quaternions,    \
      __global const float *restrict scales, __global const float *restrict opacities, \
      __global const float *restrict sh

// Gradients of the parameters, and what density control reads of them (4 floats a Gaussian).
#define RS_GRADIENT_ARGUMENTS                                                  \
  __global float *restrict g_means, __global float *restrict g_quaternions,    \
      __global float *restrict g_scales, __global float *restrict g_opacities, \
      __global float *restrict g_sh, __global float *restrict screen

// The lists of the tiles of a window (tile_lists.cl): lines of all Gaussians, then per candidate
// its Gaussian, its box in four planes of `stride` floats, its least depth and its quantile; the
// first candidate of every tile, and behind them their number.
#define RS_LIST_ARGUMENTS                                                          \
  __global const RsLine *restrict lines, __global const uint *restrict references, \
      __global const float *restrict boxes, const uint stride,                     \
      __global const float2 *restrict limits, __global const uint *restrict offsets

// The pinhole, or the face of a lens, that a launch traces; tiles and tangent coordinates of a lens
// (lens_tiles.cl), not read for pinholes.
#define RS_VIEW_ARGUMENTS                                                                    \
  const RsCamera camera_argument, const int face, __global const RsLensTile *restrict tiles, \
      __global const float *restrict tangents

// Transmittances of the pixels behind the last hit and before it, and the streams of hits
// (hit_stream.h); `access` is const for those who read them.
#define RS_STREAM_ARGUMENTS(access)                                                            \
  __global access float *restrict transmittances, __global access uint2 *restrict stream_ends, \
      __global access uint2 *restrict pool, __global access float *restrict pool_transmittance

// What a backward pass of packets reads, and the lines' gradients that it adds to.
#define RS_BACKWARD_ARGUMENTS                                                               \
  RS_VIEW_ARGUMENTS, const RsBackward backward_argument, RS_STREAM_ARGUMENTS(const),        \
      __global const RsLine *restrict lines, __global const float *restrict image_gradient, \
      __global const float *restrict depth_gradient, __global float *restrict gradients

// The gradients of the lines of the Gaussians from number `begin` to `end`, and where they are
// carried on to: the parameters, with POSE the camera too.
#define RS_FINALIZE_ARGUMENTS                                                                  \
  const uint begin, const uint end, const RsFinalize finalize, const RsCamera camera_argument, \
      __global float *restrict line_gradients, __global const RsViewBounds *restrict bounds,   \
      __global const RsLine *restrict lines, RS_GAUSSIAN_ARGUMENTS, RS_GRADIENT_ARGUMENTS,     \
      __global float *restrict pose

// Rays and the order in which they are taken, read when `ordered`.
#define RS_RAY_ARGUMENTS \
  __global const RsRay *restrict rays, const int ordered, __global const uint *restrict ray_order

#endif
