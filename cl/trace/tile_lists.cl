// SPDX-License-Identifier: Apache-2.0
// Candidate lists of image tiles. One work-item walks the LBVH for all camera rays of one tile:
// subtrees outside the tile's frustum are skipped, a leaf is kept when the box of its exact outline
// meets the tile.
//   count_tile_candidates  counts[tile] = length of the list          global: tiles
//   fill_tile_candidates   key = tile << 16 | quantised least depth, value = Gaussian << 1 |
//   general form,
//                          written at offsets[tile]                   global: tiles
//   gather_candidates      list records in sorted order               global: candidates
// The walk visits O(k log N) nodes for k candidates. Quantised depths order the list; bound[] is a
// lower bound of the depth of this and every later hit of the list, which is what the exact flush
// rule needs.
#include "shared/layout.h"

#ifndef TILE
#define TILE 32
#endif
#define RS_STACK 128

typedef struct {
  float normal[5][3];
  float reach[5];
  float x0, y0, x1, y1;
} TileFrustum;

void make_frustum(const RsCamera* camera, int tile_x, int tile_y, TileFrustum* f) {
  // Pixel centres of the tile, with slack for rounding.
  const float slack = 0.01f;
  f->x0 = (tile_x * TILE + 0.5f - slack - camera->cx) / camera->fx;
  f->x1 = (min((tile_x + 1) * TILE, camera->width) - 0.5f + slack - camera->cx) / camera->fx;
  f->y0 = (tile_y * TILE + 0.5f - slack - camera->cy) / camera->fy;
  f->y1 = (min((tile_y + 1) * TILE, camera->height) - 0.5f + slack - camera->cy) / camera->fy;
  // Inward normals in camera axes: left, right, top, bottom, front.
  const float n[5][3] = {{1, 0, -f->x0}, {-1, 0, f->x1}, {0, 1, -f->y0}, {0, -1, f->y1}, {0, 0, 1}};
  for (int p = 0; p < 5; ++p) {
    for (int j = 0; j < 3; ++j) {
      f->normal[p][j] = camera->rotation[j] * n[p][0] + camera->rotation[3 + j] * n[p][1] +
                        camera->rotation[6 + j] * n[p][2];
    }
    f->reach[p] = fabs(f->normal[p][0]) + fabs(f->normal[p][1]) + fabs(f->normal[p][2]);
  }
}

bool box_outside(const TileFrustum* f,
                 const RsCamera* camera,
                 const __global float* lo,
                 const __global float* hi) {
  const float lx = lo[0] - camera->center[0], ly = lo[1] - camera->center[1],
              lz = lo[2] - camera->center[2];
  const float hx = hi[0] - camera->center[0], hy = hi[1] - camera->center[1],
              hz = hi[2] - camera->center[2];
  for (int p = 0; p < 5; ++p) {
    const float* n = f->normal[p];
    // The corner farthest along the inward normal.
    const float far =
        n[0] * (n[0] > 0 ? hx : lx) + n[1] * (n[1] > 0 ? hy : ly) + n[2] * (n[2] > 0 ? hz : lz);
    if (!(far >= 0.0f)) return true;
  }
  return false;
}

uint depth_key(float depth) {
  if (!(depth > 0.0f)) return 0;
  return (uint)clamp((log2(depth) + 10.0f) * 2048.0f, 0.0f, 65535.0f);
}

float depth_bound(uint key) {
  return key == 0 ? 0.0f : exp2((float)key / 2048.0f - 10.0f) * 0.9999f;
}

uint walk(const int root,
          __global const RsBvhNode* restrict nodes,
          __global const uint* restrict leaves,
          __global const RsViewBounds* restrict bounds,
          const RsCamera* camera,
          const uint tile_x,
          const uint tile_y,
          const uint tile,
          const bool write,
          uint cursor,
          __global uint* restrict keys,
          __global uint* restrict values) {
  TileFrustum frustum;
  make_frustum(camera, tile_x, tile_y, &frustum);
  int stack[RS_STACK];
  int top = 0;
  uint found = 0;
  stack[top++] = root;
  while (top > 0) {
    const int reference = stack[--top];
    if (reference < 0) {
      const uint i = leaves[~reference];
      const RsViewBounds b = bounds[i];
      if (b.kind == RS_LINE_HIDDEN || b.x0 > frustum.x1 || b.x1 < frustum.x0 || b.y0 > frustum.y1 ||
          b.y1 < frustum.y0) {
        continue;
      }
      if (write) {
        keys[cursor] = tile << 16 | depth_key(b.depth);
        values[cursor] = i << 1 | (b.kind == RS_LINE_GENERAL);
        ++cursor;
      }
      ++found;
    } else {
      __global const RsBvhNode* node = nodes + reference;
      if (!box_outside(&frustum, camera, node->left_lo, node->left_hi)) stack[top++] = node->left;
      if (!box_outside(&frustum, camera, node->right_lo, node->right_hi))
        stack[top++] = node->right;
    }
  }
  return found;
}

__kernel void count_tile_candidates(const int root,
                                    __global const RsBvhNode* restrict nodes,
                                    __global const uint* restrict leaves,
                                    __global const RsViewBounds* restrict bounds,
                                    const RsCamera camera_argument,
                                    const uint tiles_x,
                                    const uint tile_row,
                                    const uint tile_count,
                                    __global uint* restrict counts) {
  const uint tile = get_global_id(0);
  if (tile >= tile_count) return;
  const RsCamera camera = camera_argument;
  counts[tile] = walk(root, nodes, leaves, bounds, &camera, tile % tiles_x,
                      tile_row + tile / tiles_x, tile, false, 0, 0, 0);
}

__kernel void fill_tile_candidates(const int root,
                                   __global const RsBvhNode* restrict nodes,
                                   __global const uint* restrict leaves,
                                   __global const RsViewBounds* restrict bounds,
                                   const RsCamera camera_argument,
                                   const uint tiles_x,
                                   const uint tile_row,
                                   const uint tile_count,
                                   __global const uint* restrict offsets,
                                   __global uint* restrict keys,
                                   __global uint* restrict values) {
  const uint tile = get_global_id(0);
  if (tile >= tile_count) return;
  const RsCamera camera = camera_argument;
  walk(root, nodes, leaves, bounds, &camera, tile % tiles_x, tile_row + tile / tiles_x, tile, true,
       offsets[tile], keys, values);
}

// The list in sorted order: boxes by component (they are tested in vectors), then what a candidate
// needs alone. boxes holds 4 planes of `stride` floats: x0, y0, x1, y1.
__kernel void gather_candidates(const uint count,
                                const uint stride,
                                __global const uint* restrict keys,
                                __global const uint* restrict values,
                                __global const RsViewBounds* restrict bounds,
                                __global float* restrict boxes,
                                __global float2* restrict limits) {
  const uint k = get_global_id(0);
  if (k >= count) return;
  const RsViewBounds b = bounds[values[k] >> 1];
  boxes[k] = b.x0;
  boxes[stride + k] = b.y0;
  boxes[2 * stride + k] = b.x1;
  boxes[3 * stride + k] = b.y1;
  limits[k] = (float2)(depth_bound(keys[k] & 0xffff), b.quantile);
}
