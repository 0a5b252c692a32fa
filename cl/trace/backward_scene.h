// SPDX-License-Identifier: Apache-2.0
// What the backward pass of a packet reads of the view, and what it reads of its own pixels.
#ifndef RS_TRACE_BACKWARD_SCENE_H
#define RS_TRACE_BACKWARD_SCENE_H

#include "trace/arguments.h"
#include "trace/line_sum.h"
#include "trace/packet.h"

// Depth has a gradient too: that of a hit is the depth of its greatest response.
#ifndef DEPTH_GRADIENT
#define DEPTH_GRADIENT 0
#endif

// RS_BACKWARD_ARGUMENTS as one.
typedef struct {
  const RsCamera* camera;
  __global const float* tangents;
  __global const float* transmittances;
  __global const uint2* stream_ends;
  __global const uint2* pool;
  __global const float* pool_transmittance;
  __global const RsLine* lines;
  __global const float* image_gradient;
  __global const float* depth_gradient;
  float4 background;
  float screen_x, screen_y;
  LineSums sums;  // of the lines' gradients
} BackwardScene;

BackwardScene backward_scene(const RsCamera* camera,
                             const RsBackward* backward,
                             __global const float* tangents,
                             RS_STREAM_ARGUMENTS(const),
                             __global const RsLine* lines,
                             __global const float* image_gradient,
                             __global const float* depth_gradient,
                             __global float* gradients) {
  BackwardScene out;
  out.camera = camera;
  out.tangents = tangents;
  out.transmittances = transmittances;
  out.stream_ends = stream_ends;
  out.pool = pool;
  out.pool_transmittance = pool_transmittance;
  out.lines = lines;
  out.image_gradient = image_gradient;
  out.depth_gradient = depth_gradient;
  out.background =
      (float4)(backward->background[0], backward->background[1], backward->background[2], 0.0f);
  out.screen_x = backward->screen_x;
  out.screen_y = backward->screen_y;
  out.sums.lines = gradients;
  out.sums.limit = backward->limit;
  return out;
}

// The rays of a packet, what is left of their light, and the gradient of their pixels.
typedef struct {
  fv X, Y;
  fv T;       // transmittance behind the last hit
  fv T_last;  // and before it
  fv gR, gG, gB, gA;
#if DEPTH_GRADIENT
  fv gS;  // of the sum of T alpha t
#endif
  fv sky;  // what a pixel gains from each unit of T behind its last hit
  float screen_x, screen_y;
} Pixels;

// Of the packet whose first pixel is (px, py). Inlined, so that the scene stays in registers.
__attribute__((always_inline)) void load_pixels(Pixels* p,
                                                const BackwardScene scene,
                                                const int px,
                                                const int py) {
  const RsCamera* camera = scene.camera;
  const int width = camera->width, height = camera->height;
  const size_t plane = (size_t)width * height;
  const PacketRays rays = rs_packet_rays(camera, scene.tangents, px, py);
  p->X = rays.X;
  p->Y = rays.Y;
  p->screen_x = scene.screen_x;
  p->screen_y = scene.screen_y;
  __global const float* gradient = scene.image_gradient;
  p->gR = rs_load_pixels(gradient, width, height, px, py);
  p->gG = rs_load_pixels(gradient + plane, width, height, px, py);
  p->gB = rs_load_pixels(gradient + 2 * plane, width, height, px, py);
  // Alpha is a fourth colour channel that is 1 in every Gaussian and 0 in the background.
  p->gA = rs_load_pixels(gradient + 3 * plane, width, height, px, py);
#if DEPTH_GRADIENT
  p->gS = rs_load_pixels(scene.depth_gradient, width, height, px, py);
#if LENS == RS_LENS_AROUND
  p->gS *= sqrt(1.0f + p->X * p->X + p->Y * p->Y);  // depths lie along the rays
#endif
#endif
  p->T = rs_load_pixels(scene.transmittances, width, height, px, py);
  p->T_last = rs_load_pixels(scene.transmittances + plane, width, height, px, py);
  p->sky = scene.background.x * p->gR + scene.background.y * p->gG + scene.background.z * p->gB;
}

#endif
