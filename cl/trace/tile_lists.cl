// SPDX-License-Identifier: Apache-2.0
// Candidate lists of image tiles: the Gaussians whose exact outline meets a tile, by least depth.
//   count_tiles        counts[i] = tiles of the window that Gaussian i meets
//   fill_tiles         key = tile << 16 | quantised least depth, value = Gaussian << 1 | general
//                      form, written at offsets[i]
//   gather_candidates  list records in sorted order, first candidate per tile
//                      global size: candidates, or more
// The first two take LANES Gaussians per work-item from number `begin` on, any local size; end -
// begin is a multiple of LANES. Cost is O(Gaussians + candidates). An outline that the camera
// plane makes unbounded is replaced by the box of the ellipsoid against the planes of the tile.
// Quantised depths order the list and are a lower bound of the depth of this and every later hit of
// the list, which is what the exact order of rays rests on. A window is a rectangle of tiles: first
// column, first row, columns, rows; its tiles are numbered row by row. live[0] candidates are
// listed: as many as were counted, or none (view_sizes.cl); live[1] is the first step of depths
// (depth_key.h).
#include "parallel/prefetch.h"
#include "shared/layout.h"
#include "trace/depth_key.h"
#include "trace/gaussian_lanes.h"

#ifndef TILE
#define TILE 32
#endif
#ifndef PEAK_ORDER
#define PEAK_ORDER 0
#endif
// 0: the tiles of a pinhole, a regular grid in tangent coordinates. 1: those of a lens, each with a
// box around its rays on one face of a cube (lens_tiles.cl); a launch fills the tiles of one face.
#ifndef LENS
#define LENS RS_LENS_PINHOLE
#endif

// Pixel centres count as this much wider, for rounding.
#define RS_TILE_SLACK 0.01f

// Columns of RsViewBounds.
#define RS_BOUNDS_X0 0
#define RS_BOUNDS_Y0 1
#define RS_BOUNDS_X1 2
#define RS_BOUNDS_Y1 3
#define RS_BOUNDS_DEPTH 4
#define RS_BOUNDS_QUANTILE 5
#define RS_BOUNDS_KIND 6

typedef struct {
  IntLanes x0, y0, x1, y1;  // first and last tile of the outline's box
} TileRanges;

iv round_down(const fv v) {
  const iv whole = rs_to_int(v);
  return whole - (rs_to_float(whole) > v ? (iv)(1) : (iv)(0));
}

// First tile whose last pixel centre is at or behind `pixel`; last tile whose first is before it.
iv first_tile(const fv pixel) {
  return -round_down(-(pixel + 0.5f - RS_TILE_SLACK) * (1.0f / TILE)) - 1;
}
iv last_tile(const fv pixel) { return round_down((pixel - 0.5f + RS_TILE_SLACK) * (1.0f / TILE)); }

iv lesser(const iv a, const int b) { return a < b ? a : (iv)(b); }
iv greater(const iv a, const int b) { return a > b ? a : (iv)(b); }
// Pixels far outside would overflow integers; the largest picture has 2^20 a side.
fv within_reach(const fv pixel) {
  return smaller(larger(pixel, (fv)(-2097152.0f)), (fv)(2097152.0f));
}

#if LENS
// Where the tiles of a face are.
typedef struct {
  __global const RsLensTile* tiles;
  __global const float4* spans;  // box around each row of tiles, then around each column
  int face, tiles_x, tile_rows;
} LensTiles;

// Lanes whose outline's box meets a box (x0, y0, x1, y1).
iv outline_meets(const fv* b, const float4 box) {
  return (b[RS_BOUNDS_X0] <= box.z) & (b[RS_BOUNDS_X1] >= box.x) & (b[RS_BOUNDS_Y0] <= box.w) &
         (b[RS_BOUNDS_Y1] >= box.y);
}

iv tile_ranges(const fv* b, const LensTiles* lens, const int4 window, TileRanges* range) {
  range->x0.v = range->y0.v = (iv)(0x7fffffff);
  range->x1.v = range->y1.v = (iv)(-1);
  for (int y = window.y; y < min(window.y + window.w, lens->tile_rows); ++y) {
    const iv meets = outline_meets(b, lens->spans[y]);
    range->y0.v = (meets & (range->y0.v > y)) ? (iv)(y) : range->y0.v;
    range->y1.v = meets ? (iv)(y) : range->y1.v;
  }
  for (int x = window.x; x < min(window.x + window.z, lens->tiles_x); ++x) {
    const iv meets = outline_meets(b, lens->spans[lens->tile_rows + x]);
    range->x0.v = (meets & (range->x0.v > x)) ? (iv)(x) : range->x0.v;
    range->x1.v = meets ? (iv)(x) : range->x1.v;
  }
  return (rs_as_int(b[RS_BOUNDS_KIND]) == RS_LINE_HIDDEN) | (range->x1.v < range->x0.v) |
         (range->y1.v < range->y0.v);
}
#else
// Finds the tiles of the window that Gaussians with bounds b may meet. Returns the lanes with an
// empty range.
iv tile_ranges(const fv* b, const RsCamera* camera, const int4 window, TileRanges* range) {
  const fv x0 = within_reach(b[RS_BOUNDS_X0] * camera->fx + camera->cx);
  const fv x1 = within_reach(b[RS_BOUNDS_X1] * camera->fx + camera->cx);
  const fv y0 = within_reach(b[RS_BOUNDS_Y0] * camera->fy + camera->cy);
  const fv y1 = within_reach(b[RS_BOUNDS_Y1] * camera->fy + camera->cy);
  range->x0.v = greater(first_tile(x0), window.x);
  range->y0.v = greater(first_tile(y0), window.y);
  range->x1.v =
      lesser(last_tile(x1), min(window.x + window.z, (camera->width + TILE - 1) / TILE) - 1);
  range->y1.v =
      lesser(last_tile(y1), min(window.y + window.w, (camera->height + TILE - 1) / TILE) - 1);
  const iv kind = rs_as_int(b[RS_BOUNDS_KIND]);
  return (kind == RS_LINE_HIDDEN) | (x0 > camera->width - 0.5f + RS_TILE_SLACK) |
         (y0 > camera->height - 0.5f + RS_TILE_SLACK) | (range->x1.v < range->x0.v) |
         (range->y1.v < range->y0.v);
}

#endif

// Box of a tile in tangent coordinates: x0, y0, x1, y1.
float4 tile_box(const RsCamera* camera, const int tile_x, const int tile_y) {
  return (float4)((tile_x * TILE + 0.5f - RS_TILE_SLACK - camera->cx) / camera->fx,
                  (tile_y * TILE + 0.5f - RS_TILE_SLACK - camera->cy) / camera->fy,
                  (min((tile_x + 1) * TILE, camera->width) - 0.5f + RS_TILE_SLACK - camera->cx) /
                      camera->fx,
                  (min((tile_y + 1) * TILE, camera->height) - 0.5f + RS_TILE_SLACK - camera->cy) /
                      camera->fy);
}

// How far beyond its box a Gaussian may reach whose axes are raised to the view's footprint
// (view_footprint.h), in footprints: the root of the largest quantile that is possible.
#define RS_FOOTPRINT_REACH 10.0f

// Whether the planes of a tile's frustum keep the box out; it may still be outside when not.
bool box_outside(const RsCamera* camera, const float4 tile, __global const RsAabb* box) {
  // Inward normals in camera axes: left, right, top, bottom, front.
  const float n[5][3] = {
      {1, 0, -tile.x}, {-1, 0, tile.z}, {0, 1, -tile.y}, {0, -1, tile.w}, {0, 0, 1}};
  for (int p = 0; p < 5; ++p) {
    float most = 0.0f, scale = 0.0f;  // distance of the box's farthest corner along the normal
    float far = 0.0f;                 // of its corner that is farthest from the camera, or more
    for (int j = 0; j < 3; ++j) {
      const float normal = camera->rotation[j] * n[p][0] + camera->rotation[3 + j] * n[p][1] +
                           camera->rotation[6 + j] * n[p][2];
      const float lo = normal * (box->lo[j] - camera->center[j]);
      const float hi = normal * (box->hi[j] - camera->center[j]);
      most += fmax(lo, hi);
      scale += fabs(lo) + fabs(hi);
      far += fmax(fabs(box->lo[j] - camera->center[j]), fabs(box->hi[j] - camera->center[j]));
    }
    const float length = fabs(n[p][0]) + fabs(n[p][1]) + fabs(n[p][2]);
    const float beyond = RS_FOOTPRINT_REACH * camera->footprint * far * length;
    if (most < -1e-5f * scale - beyond) return true;
  }
  return false;
}

// Box of the tangent coordinates of all tiles that a launch may fill, whatever its window. Most of
// what the camera plane cuts lies beside it, so that none of its tiles has to be asked.
#if LENS
float4 picture_box(const LensTiles* lens) {
  float4 box = (float4)(INFINITY, INFINITY, -INFINITY, -INFINITY);
  for (int y = 0; y < lens->tile_rows; ++y) {
    const float4 row = lens->spans[y];
    box = (float4)(fmin(box.xy, row.xy), fmax(box.zw, row.zw));
  }
  return box;
}
#else
float4 picture_box(const RsCamera* camera) {
  const float4 first = tile_box(camera, 0, 0);
  const float4 last = tile_box(camera, (camera->width - 1) / TILE, (camera->height - 1) / TILE);
  return (float4)(first.xy, last.zw);
}
#endif

#if LENS
// Whether a tile belongs to the face and its box meets the outline, of which lane `lane` is asked.
bool lens_tile_meets(const LensTiles* lens,
                     const int x,
                     const int y,
                     const FloatLanes* outline,
                     const int lane,
                     const RsCamera* camera,
                     __global const RsAabb* box) {
  const RsLensTile tile = lens->tiles[y * lens->tiles_x + x];
  if (tile.face != lens->face || !(outline[RS_BOUNDS_X0].s[lane] <= tile.x1) ||
      !(outline[RS_BOUNDS_X1].s[lane] >= tile.x0) || !(outline[RS_BOUNDS_Y0].s[lane] <= tile.y1) ||
      !(outline[RS_BOUNDS_Y1].s[lane] >= tile.y0))
    return false;
  return outline[RS_BOUNDS_X0].s[lane] != -INFINITY ||
         !box_outside(camera, (float4)(tile.x0, tile.y0, tile.x1, tile.y1), box);
}

__kernel void count_tiles(const uint begin,
                          const uint end,
                          __global const RsViewBounds* restrict bounds,
                          __global const RsAabb* restrict boxes,
                          const RsCamera camera_argument,
                          const int4 window,
                          __global uint* restrict counts,
                          const int face,
                          __global const RsLensTile* restrict tiles,
                          __global const float4* restrict spans) {
  const size_t i = begin + get_global_id(0) * (size_t)LANES;
  if (i >= end) return;
  const RsCamera camera = camera_argument;
  const LensTiles lens = {tiles, spans, face, (camera.width + TILE - 1) / TILE,
                          (camera.height + TILE - 1) / TILE};
  FloatLanes outline[8];
  fv b[8];
  load_records8((__global const float*)(bounds + i), b);
  for (int k = 0; k < 4; ++k) outline[k].v = b[k];
  TileRanges range;
  IntLanes empty;
  empty.v = tile_ranges(b, &lens, window, &range);
  const float4 picture = picture_box(&lens);
  for (int lane = 0; lane < LANES; ++lane) {
    uint found = 0;
    const bool none = empty.s[lane] != 0 || (outline[RS_BOUNDS_X0].s[lane] == -INFINITY &&
                                             box_outside(&camera, picture, boxes + i + lane));
    if (!none) {
      for (int y = range.y0.s[lane]; y <= range.y1.s[lane]; ++y) {
        for (int x = range.x0.s[lane]; x <= range.x1.s[lane]; ++x)
          found += lens_tile_meets(&lens, x, y, outline, lane, &camera, boxes + i + lane);
      }
    }
    counts[i + lane] = found;
  }
}
#else
uint tiles_of_box(const TileRanges* range,
                  const int lane,
                  const RsCamera* camera,
                  __global const RsAabb* box) {
  if (box_outside(camera, picture_box(camera), box)) return 0;
  uint found = 0;
  for (int y = range->y0.s[lane]; y <= range->y1.s[lane]; ++y) {
    for (int x = range->x0.s[lane]; x <= range->x1.s[lane]; ++x)
      found += !box_outside(camera, tile_box(camera, x, y), box);
  }
  return found;
}

__kernel void count_tiles(const uint begin,
                          const uint end,
                          __global const RsViewBounds* restrict bounds,
                          __global const RsAabb* restrict boxes,
                          const RsCamera camera_argument,
                          const int4 window,
                          __global uint* restrict counts) {
  const size_t i = begin + get_global_id(0) * (size_t)LANES;
  if (i >= end) return;
  const RsCamera camera = camera_argument;
  fv b[8];
  load_records8((__global const float*)(bounds + i), b);
  TileRanges range;
  const iv empty = tile_ranges(b, &camera, window, &range);
  IntLanes found;
  found.v = (range.x1.v - range.x0.v + 1) * (range.y1.v - range.y0.v + 1);
  found.v = empty ? (iv)(0) : found.v;
  const iv unbounded = b[RS_BOUNDS_X0] == -INFINITY;
  if (rs_any_of(unbounded & !empty)) {
    IntLanes mask;
    mask.v = unbounded & !empty;
    for (int lane = 0; lane < LANES; ++lane) {
      if (mask.s[lane] != 0) found.s[lane] = tiles_of_box(&range, lane, &camera, boxes + i + lane);
    }
  }
  *(__global rs_int_unaligned*)(counts + i) = found.v;
}

#endif

iv depth_key(const fv depth, const uint first_step) {
  const iv step = (rs_as_int(depth) >> RS_DEPTH_BITS) - (iv)((int)first_step);
  return lesser(greater(step, 0), RS_DEPTH_KEYS - 1);
}

// What the least depth of Gaussians in a tile needs of their lines.
typedef struct {
  fv mean_x, mean_y;
  fv slope_x, slope_y;  // of -<o', d'> in shares of what it is towards the mean
  fv most_x, most_y;    // what a slope adds at the end of the outline
  fv limit;             // depth of the plane towards the mean
  fv depth;             // no hit is nearer
} DepthPlanes;

// Lower bound of the depth of all hits of one Gaussian in a tile: of its own least depth, and of
// the plane <o', x'> = limit in whitened space, beyond which all its hits lie: limit is Q in peak
// order (Thales: peaks lie on the sphere over mean and camera), sqrt(Q) |o'| for near roots; here
// in shares of |o'|^2. The depth of the plane is a ratio of linear functions of the ray, so its
// least value is at a corner.
void depth_planes(const fv* b, __global const RsLine* lines, DepthPlanes* planes) {
  fv v[16];
  load_columns(lines->v, 16, LANES == 1 ? 9 : 16, v);
  const fv relative = b[RS_BOUNDS_QUANTILE] * v[8];
#if PEAK_ORDER
  const fv limit = relative;
#else
  const fv limit = sqrt(relative);
#endif
  const iv projective = rs_as_int(b[RS_BOUNDS_KIND]) == RS_LINE_PROJECTIVE;
  planes->mean_x = v[0];
  planes->mean_y = v[1];
  planes->slope_x = v[6];
  planes->slope_y = v[7];
  planes->most_x = v[6] * ((v[6] > 0.0f ? b[RS_BOUNDS_X1] : b[RS_BOUNDS_X0]) - v[0]);
  planes->most_y = v[7] * ((v[7] > 0.0f ? b[RS_BOUNDS_Y1] : b[RS_BOUNDS_Y0]) - v[1]);
  planes->limit = projective ? (1.0f - limit) * v[2] * 0.9999f : (fv)(0.0f);
  planes->depth = b[RS_BOUNDS_DEPTH];
}

// What a slope adds up to the farther edge of a tile, the product at most at the outline's end.
fv most_along(const fv slope, const fv low, const fv high, const fv mean, const fv most) {
  const fv edge = slope > 0.0f ? high : low;
  return smaller(slope * (edge - mean), most);
}

// All lanes take the tiles of their range in turn, row by row.
__kernel void fill_tiles(const uint begin,
                         const uint end,
                         __global const RsViewBounds* restrict bounds,
                         __global const RsAabb* restrict boxes,
                         __global const RsLine* restrict lines,
                         const RsCamera camera_argument,
                         const int4 window,
                         __global const uint* restrict offsets,
#if LENS
                         const int face,
                         __global const RsLensTile* restrict tiles,
                         __global const float4* restrict spans,
#endif
                         __global const uint* restrict live,
                         __global uint* restrict keys,
                         __global uint* restrict values) {
  const size_t i = begin + get_global_id(0) * (size_t)LANES;
  if (i >= end || live[0] == 0 || offsets[i] == offsets[i + LANES]) return;
  const RsCamera camera = camera_argument;
  fv b[8];
  load_records8((__global const float*)(bounds + i), b);
  TileRanges range;
#if LENS
  const int tiles_x = (camera.width + TILE - 1) / TILE;
  const LensTiles lens = {tiles, spans, face, tiles_x, (camera.height + TILE - 1) / TILE};
  FloatLanes outline[8];
  for (int k = 0; k < 4; ++k) outline[k].v = b[k];
  const iv empty = tile_ranges(b, &lens, window, &range);
#else
  const iv empty = tile_ranges(b, &camera, window, &range);
  const float size_x = TILE / camera.fx, size_y = TILE / camera.fy;
  const float centre_x = camera.cx / camera.fx, centre_y = camera.cy / camera.fy;
  IntLanes unbounded;
  unbounded.v = b[RS_BOUNDS_X0] == -INFINITY;
#endif
  const uint first_step = live[1];
  DepthPlanes planes;
  depth_planes(b, lines + i, &planes);
  IntLanes general;
  general.v = rs_as_int(b[RS_BOUNDS_KIND]) == RS_LINE_GENERAL;
  const fv zero = (fv)(0.0f);
  uint cursor[LANES];
  for (int lane = 0; lane < LANES; ++lane) cursor[lane] = offsets[i + lane];
  IntLanes x, y, key, left;
  x.v = range.x0.v;
  y.v = range.y0.v;
  left.v = !empty;
  // Those that were counted in no tile.
  for (int lane = 0; lane < LANES; ++lane)
    left.s[lane] = offsets[i + lane + 1] == offsets[i + lane] ? 0 : left.s[lane];
  for (; rs_any_of(left.v); left.v = left.v & (y.v <= range.y1.v)) {
#if LENS
    FloatLanes edge[4];
    for (int lane = 0; lane < LANES; ++lane) {
      edge[0].s[lane] = edge[1].s[lane] = edge[2].s[lane] = edge[3].s[lane] = 0.0f;
      if (left.s[lane] == 0) continue;
      const RsLensTile tile = tiles[y.s[lane] * tiles_x + x.s[lane]];
      edge[0].s[lane] = tile.x0;
      edge[1].s[lane] = tile.y0;
      edge[2].s[lane] = tile.x1;
      edge[3].s[lane] = tile.y1;
    }
    const fv low_x = edge[0].v, low_y = edge[1].v, high_x = edge[2].v, high_y = edge[3].v;
#else
    const fv low_x = rs_to_float(x.v) * size_x - centre_x;
    const fv low_y = rs_to_float(y.v) * size_y - centre_y;
    const fv high_x = (rs_to_float(x.v) + 1.0f) * size_x - centre_x;
    const fv high_y = (rs_to_float(y.v) + 1.0f) * size_y - centre_y;
#endif
    const fv along = 1.0f +
                     most_along(planes.slope_y, low_y, high_y, planes.mean_y, planes.most_y) +
                     most_along(planes.slope_x, low_x, high_x, planes.mean_x, planes.most_x);
    const fv plane = ((along > 0.0f) & (planes.limit > 0.0f)) ? planes.limit / along : zero;
    key.v = ((y.v - window.y) * window.z + (x.v - window.x)) << 16 |
            depth_key(larger(plane, planes.depth), first_step);
    for (int lane = 0; lane < LANES; ++lane) {
      if (left.s[lane] == 0) continue;
#if LENS
      if (!lens_tile_meets(&lens, x.s[lane], y.s[lane], outline, lane, &camera, boxes + i + lane))
        continue;
#else
      if (unbounded.s[lane] &&
          box_outside(&camera, tile_box(&camera, x.s[lane], y.s[lane]), boxes + i + lane))
        continue;
#endif
      const uint to = cursor[lane]++;
      keys[to] = key.s[lane];
      values[to] = (uint)(i + lane) << 1 | (general.s[lane] != 0);
    }
    const iv turn = x.v >= range.x1.v;
    x.v = turn ? range.x0.v : x.v + 1;
    y.v = turn ? y.v + 1 : y.v;
  }
}

// Candidates whose bounds are fetched ahead of the one that is written.
#define RS_GATHER_AHEAD 32

// boxes holds 4 planes of `stride` floats (x0, y0, x1, y1: they are tested in vectors); limits is
// what a candidate needs alone. tile_offsets[t] .. tile_offsets[t + 1] is the list of tile t.
__kernel void gather_candidates(__global const uint* restrict live,
                                const uint stride,
                                const uint tiles,
                                __global const uint* restrict keys,
                                __global const uint* restrict values,
                                __global const RsViewBounds* restrict bounds,
                                __global float* restrict boxes,
                                __global float2* restrict limits,
                                __global uint* restrict tile_offsets) {
  const uint k = get_global_id(0), count = live[0];
  if (k >= count) {
    for (uint t = 0; k == 0 && t <= tiles; ++t) tile_offsets[t] = 0;
    return;
  }
  RS_PREFETCH_READ(bounds + (values[min(k + RS_GATHER_AHEAD, count - 1)] >> 1));
  const uint key = keys[k];
  const RsViewBounds b = bounds[values[k] >> 1];
  boxes[k] = b.x0;
  boxes[stride + k] = b.y0;
  boxes[2 * (size_t)stride + k] = b.x1;
  boxes[3 * (size_t)stride + k] = b.y1;
  limits[k] = (float2)(depth_bound(key & 0xffff, live[1]), b.quantile);
  const uint tile = key >> 16;
  for (uint t = k == 0 ? 0 : (keys[k - 1] >> 16) + 1; t <= tile; ++t) tile_offsets[t] = k;
  if (k == count - 1) {
    for (uint t = tile + 1; t <= tiles; ++t) tile_offsets[t] = count;
  }
}
