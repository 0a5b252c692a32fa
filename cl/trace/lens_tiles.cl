// SPDX-License-Identifier: Apache-2.0
// What tracing in packets needs of a central camera that is no pinhole: all its rays share their
// origin, so every tile of the picture is seen by a pinhole of its own axes, one of six faces of a
// cube around the camera, and only the places of the pixels in its image plane are the lens's.
//   lens_directions  unit direction of every pixel in camera axes, NaN where it sees nothing
//   lens_tiles       the face of every tile, the tangent coordinates X = x/z, Y = y/z of its pixels
//                    in the face's axes (over the first two planes), and the box around them
// Both once per lens, whatever the pose. Launch: one work-item per pixel, one per tile. Cost per
// pixel: lens.h, then a few operations.
#include "trace/lens.h"

#ifndef TILE
#define TILE 32
#endif
// The front face sees a tile whose mean direction is this near to its axis (cosine): lenses up to
// about 130 degrees across need no other.
#define RS_FRONT 0.4f

// directions: three planes of width x height.
__kernel void lens_directions(const RsLensCamera camera, __global float* restrict directions) {
  const uint pixel = get_global_id(0);
  const uint pixels = (uint)camera.width * (uint)camera.height;
  if (pixel >= pixels) return;
  const uint row = pixel / (uint)camera.width;
  float3 direction = (float3)(NAN);
  const bool valid = lens_direction(&camera, (float)(pixel - row * (uint)camera.width), (float)row,
                                    (float2)(0.5f), &direction);
  direction = valid ? direction * rsqrt(dot(direction, direction)) : (float3)(NAN);
  directions[pixel] = direction.x;
  directions[pixels + pixel] = direction.y;
  directions[2 * (size_t)pixels + pixel] = direction.z;
}

__kernel void lens_tiles(const int width,
                         const int height,
                         const int faces,
                         const RsLensFaces axes_argument,
                         __global float* restrict directions,
                         __global RsLensTile* restrict tiles) {
  const int tiles_x = (width + TILE - 1) / TILE;
  const uint tile = get_global_id(0);
  if (tile >= (uint)(tiles_x * ((height + TILE - 1) / TILE))) return;
  const RsLensFaces axes = axes_argument;
  const int begin_x = (int)(tile % tiles_x) * TILE, end_x = min(begin_x + TILE, width);
  const int begin_y = (int)(tile / tiles_x) * TILE, end_y = min(begin_y + TILE, height);
  __global float* xs = directions;
  __global float* ys = xs + (size_t)width * height;
  __global const float* zs = ys + (size_t)width * height;
  float3 mean = (float3)(0.0f);
  for (int y = begin_y; y < end_y; ++y) {
    for (int x = begin_x; x < end_x; ++x) {
      const size_t i = (size_t)y * width + x;
      if (xs[i] == xs[i]) mean += (float3)(xs[i], ys[i], zs[i]);
    }
  }
  int face = 0;
  float nearest = faces > 1 ? RS_FRONT * length(mean) : -INFINITY;
  if (!(mean.z >= nearest)) {
    nearest = -INFINITY;
    for (int f = 1; f < faces; ++f) {
      const float* axis = axes.rows[f] + 6;
      const float along = axis[0] * mean.x + axis[1] * mean.y + axis[2] * mean.z;
      if (along > nearest) {
        nearest = along;
        face = f;
      }
    }
  }
  RsLensTile out;
  out.x0 = out.y0 = INFINITY;
  out.x1 = out.y1 = -INFINITY;
  out.face = face;
  out.cosine = 1.0f;
  out.padding[0] = out.padding[1] = 0;
  const float* m = axes.rows[face];
  for (int y = begin_y; y < end_y; ++y) {
    for (int x = begin_x; x < end_x; ++x) {
      const size_t i = (size_t)y * width + x;
      const float3 d = (float3)(xs[i], ys[i], zs[i]);
      if (!(d.x == d.x)) continue;
      const float z = m[6] * d.x + m[7] * d.y + m[8] * d.z;
      const float X = (m[0] * d.x + m[1] * d.y + m[2] * d.z) / z;
      const float Y = (m[3] * d.x + m[4] * d.y + m[5] * d.z) / z;
      xs[i] = X;
      ys[i] = Y;
      out.x0 = fmin(out.x0, X);
      out.y0 = fmin(out.y0, Y);
      out.x1 = fmax(out.x1, X);
      out.y1 = fmax(out.y1, Y);
      out.cosine = fmin(out.cosine, z);
    }
  }
  tiles[tile] = out;
}
