// SPDX-License-Identifier: Apache-2.0
// Candidate lists of image tiles: the Gaussians whose exact outline meets a tile, by least depth.
//   count_tiles        counts[i] = tiles of the band that Gaussian i meets      global: Gaussians
//   fill_tiles         key = tile << 16 | quantised least depth, value = Gaussian << 1 | general
//                      form, written at offsets[i]                              global: Gaussians
//   gather_candidates  list records in sorted order, first candidate per tile   global: candidates
// Cost is O(Gaussians + candidates). An outline that the camera plane makes unbounded is replaced
// by the box of the ellipsoid against the planes of the tile. Quantised depths order the list and
// are a lower bound of the depth of this and every later hit of the list, which is what the exact
// order of rays rests on.
#include "shared/layout.h"

#ifndef TILE
#define TILE 32
#endif
#ifndef PEAK_ORDER
#define PEAK_ORDER 0
#endif

// Pixel centres count as this much wider, for rounding.
#define RS_TILE_SLACK 0.01f

typedef struct {
  int x0, y0, x1, y1;  // first and last tile of the outline's box, empty when x0 > x1 or y0 > y1
} TileRange;

// First tile whose last pixel centre is at or behind `pixel`; last tile whose first is before it.
int first_tile(float pixel) { return (int)ceil((pixel + 0.5f - RS_TILE_SLACK) / TILE) - 1; }
int last_tile(float pixel) { return (int)floor((pixel - 0.5f + RS_TILE_SLACK) / TILE); }

TileRange tile_range(const RsViewBounds* b, const RsCamera* camera, const int row, const int rows) {
  // Far outside numbers would overflow integers.
  const float far = 1e6f;
  const float x0 = clamp(b->x0 * camera->fx + camera->cx, -far, far);
  const float x1 = clamp(b->x1 * camera->fx + camera->cx, -far, far);
  const float y0 = clamp(b->y0 * camera->fy + camera->cy, -far, far);
  const float y1 = clamp(b->y1 * camera->fy + camera->cy, -far, far);
  TileRange range;
  range.x0 = max(first_tile(x0), 0);
  range.y0 = max(first_tile(y0), row);
  range.x1 = min(last_tile(x1), (camera->width - 1) / TILE);
  range.y1 = min(last_tile(y1), min(row + rows, (camera->height + TILE - 1) / TILE) - 1);
  const bool visible = b->kind != RS_LINE_HIDDEN && x0 <= camera->width - 0.5f + RS_TILE_SLACK &&
                       y0 <= camera->height - 0.5f + RS_TILE_SLACK;
  if (!visible) range.x1 = range.x0 - 1;
  return range;
}

bool is_unbounded(const RsViewBounds* b) { return b->x0 == -INFINITY; }

// Whether the planes of a tile's frustum keep the box out; it may still be outside when not.
bool box_outside(const RsCamera* camera, const int tile_x, const int tile_y, const RsAabb* box) {
  const float x0 = (tile_x * TILE + 0.5f - RS_TILE_SLACK - camera->cx) / camera->fx;
  const float x1 =
      (min((tile_x + 1) * TILE, camera->width) - 0.5f + RS_TILE_SLACK - camera->cx) / camera->fx;
  const float y0 = (tile_y * TILE + 0.5f - RS_TILE_SLACK - camera->cy) / camera->fy;
  const float y1 =
      (min((tile_y + 1) * TILE, camera->height) - 0.5f + RS_TILE_SLACK - camera->cy) / camera->fy;
  // Inward normals in camera axes: left, right, top, bottom, front.
  const float n[5][3] = {{1, 0, -x0}, {-1, 0, x1}, {0, 1, -y0}, {0, -1, y1}, {0, 0, 1}};
  for (int p = 0; p < 5; ++p) {
    float most = 0.0f, scale = 0.0f;  // distance of the box's farthest corner along the normal
    for (int j = 0; j < 3; ++j) {
      const float normal = camera->rotation[j] * n[p][0] + camera->rotation[3 + j] * n[p][1] +
                           camera->rotation[6 + j] * n[p][2];
      const float lo = normal * (box->lo[j] - camera->center[j]);
      const float hi = normal * (box->hi[j] - camera->center[j]);
      most += fmax(lo, hi);
      scale += fabs(lo) + fabs(hi);
    }
    if (most < -1e-5f * scale) return true;
  }
  return false;
}

__kernel void count_tiles(const uint count,
                          __global const RsViewBounds* restrict bounds,
                          __global const RsAabb* restrict boxes,
                          const RsCamera camera_argument,
                          const int row,
                          const int rows,
                          __global uint* restrict counts) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const RsCamera camera = camera_argument;
  const RsViewBounds b = bounds[i];
  const TileRange range = tile_range(&b, &camera, row, rows);
  uint found = 0;
  if (range.x1 >= range.x0 && range.y1 >= range.y0) {
    if (is_unbounded(&b)) {
      const RsAabb box = boxes[i];
      for (int y = range.y0; y <= range.y1; ++y) {
        for (int x = range.x0; x <= range.x1; ++x) found += !box_outside(&camera, x, y, &box);
      }
    } else {
      found = (uint)(range.x1 - range.x0 + 1) * (uint)(range.y1 - range.y0 + 1);
    }
  }
  counts[i] = found;
}

uint depth_key(float depth) {
  if (!(depth > 0.0f)) return 0;
  return (uint)clamp((log2(depth) + 10.0f) * 2048.0f, 0.0f, 65535.0f);
}

float depth_bound(uint key) {
  return key == 0 ? 0.0f : exp2((float)key / 2048.0f - 10.0f) * 0.9999f;
}

// Lower bound of the depth of all hits of one Gaussian in a tile: of its own least depth, and of
// the plane <o', x'> = limit in whitened space, beyond which all its hits lie: limit is Q in peak
// order (Thales: peaks lie on the sphere over mean and camera), sqrt(Q) |o'| for near roots. The
// depth of the plane is a ratio of linear functions of the ray, so its least value is at a corner.
float least_depth(const RsViewBounds* b,
                  __global const float* v,
                  const RsCamera* camera,
                  const int tile_x,
                  const int tile_y) {
  if (b->kind != RS_LINE_PROJECTIVE) return b->depth;
  const float x = v[7] > 0.0f ? fmin(b->x1, ((tile_x + 1) * TILE - camera->cx) / camera->fx)
                              : fmax(b->x0, (tile_x * TILE - camera->cx) / camera->fx);
  const float y = v[8] > 0.0f ? fmin(b->y1, ((tile_y + 1) * TILE - camera->cy) / camera->fy)
                              : fmax(b->y0, (tile_y * TILE - camera->cy) / camera->fy);
  const float along = v[6] + v[7] * (x - v[0]) + v[8] * (y - v[1]);
  const float origin2 = v[6] * v[2] * v[2];
#if PEAK_ORDER
  const float limit = b->quantile;
#else
  const float limit = sqrt(b->quantile * origin2);
#endif
  const float plane = along > 0.0f ? (origin2 - limit) / (v[2] * along) : 0.0f;
  return fmax(b->depth, plane * 0.9999f);
}

__kernel void fill_tiles(const uint count,
                         __global const RsViewBounds* restrict bounds,
                         __global const RsAabb* restrict boxes,
                         __global const RsLine* restrict lines,
                         const RsCamera camera_argument,
                         const int row,
                         const int rows,
                         __global const uint* restrict offsets,
                         __global uint* restrict keys,
                         __global uint* restrict values) {
  const uint i = get_global_id(0);
  if (i >= count || offsets[i] == offsets[i + 1]) return;
  const RsCamera camera = camera_argument;
  const RsViewBounds b = bounds[i];
  const TileRange range = tile_range(&b, &camera, row, rows);
  const bool unbounded = is_unbounded(&b);
  const RsAabb box = boxes[i];
  const int tiles_x = (camera.width + TILE - 1) / TILE;
  const uint value = i << 1 | (b.kind == RS_LINE_GENERAL);
  uint cursor = offsets[i];
  for (int y = range.y0; y <= range.y1; ++y) {
    for (int x = range.x0; x <= range.x1; ++x) {
      if (unbounded && box_outside(&camera, x, y, &box)) continue;
      const uint tile = (uint)((y - row) * tiles_x + x);
      keys[cursor] = tile << 16 | depth_key(least_depth(&b, lines[i].v, &camera, x, y));
      values[cursor] = value;
      ++cursor;
    }
  }
}

// boxes holds 4 planes of `stride` floats (x0, y0, x1, y1: they are tested in vectors); limits is
// what a candidate needs alone. tile_offsets[t] .. tile_offsets[t + 1] is the list of tile t.
__kernel void gather_candidates(const uint count,
                                const uint stride,
                                const uint tiles,
                                __global const uint* restrict keys,
                                __global const uint* restrict values,
                                __global const RsViewBounds* restrict bounds,
                                __global float* restrict boxes,
                                __global float2* restrict limits,
                                __global uint* restrict tile_offsets) {
  const uint k = get_global_id(0);
  if (k >= count) return;
  const uint key = keys[k];
  const RsViewBounds b = bounds[values[k] >> 1];
  boxes[k] = b.x0;
  boxes[stride + k] = b.y0;
  boxes[2 * (size_t)stride + k] = b.x1;
  boxes[3 * (size_t)stride + k] = b.y1;
  limits[k] = (float2)(depth_bound(key & 0xffff), b.quantile);
  const uint tile = key >> 16;
  for (uint t = k == 0 ? 0 : (keys[k - 1] >> 16) + 1; t <= tile; ++t) tile_offsets[t] = k;
  if (k == count - 1) {
    for (uint t = tile + 1; t <= tiles; ++t) tile_offsets[t] = count;
  }
}
