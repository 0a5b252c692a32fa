// SPDX-License-Identifier: Apache-2.0
// trace_forward: colour and alpha of every pixel, exactly in depth order per ray. One work-item is
// a packet of PACKET rays (packet.h); the packets of a tile share its candidate list, sorted by a
// lower bound of the depth.
//   global size: packets in x, packet rows of the band; local: the packets of a tile (any size is
//   correct)
// Per candidate that meets the packet's block: test all rays at once, insert into a sorted list per
// lane (lanes that miss carry alpha 0 at a virtual depth, which keeps neighbouring lanes aligned),
// after blending whatever lies before the candidate's bound in all lanes: nothing that comes later
// can be nearer. The pending list holds PENDING entries. If more are needed the farthest hits are
// dropped and found again in another pass over the list that continues behind the last blended
// (depth, index): exact for any PENDING >= 1. Cost follows the candidates of the tile that meet the
// packet's box; blending is one broadcast per Gaussian.
#include "trace/hit_stream.h"
#include "trace/packet.h"

#ifndef TILE
#define TILE 32
#endif
#ifndef PENDING
#define PENDING 96
#endif
#ifndef PEAK_ORDER
#define PEAK_ORDER 0
#endif
#ifndef WITH_DEPTH
#define WITH_DEPTH 0
#endif
#ifndef KEEP_HITS
#define KEEP_HITS 0
#endif

typedef struct {
  fv X, Y;
  fv T, R, G, B;
  fv T_last;  // transmittance before the last hit
  iv alive;   // lanes that still take hits
  iv hits;
#if WITH_DEPTH
  fv depth_sum, median;
#endif
} Packet;

typedef struct {
  fv key[PENDING];
  fv alpha[PENDING];  // 0 in lanes that miss
  iv reference[PENDING];
  int head, size;
} Pending;

__kernel void trace_forward(__global const RsLine* restrict lines,
                            __global const uint* restrict references,
                            __global const float* restrict boxes,
                            const uint stride,
                            __global const float2* restrict limits,
                            __global const uint* restrict offsets,
                            const RsCamera camera_argument,
                            const uint tiles_x,
                            const uint tile_row,
                            const float min_transmittance,
                            const int max_hits,
                            const float4 background,
                            __global float* restrict image,
                            __global float* restrict depth_image,
                            __global float* restrict last_transmittance,
                            __global uint2* restrict stream_ends,
                            __global uint2* restrict pool,
                            const uint pool_capacity,
                            volatile __global uint* restrict counters) {
#if !WITH_DEPTH
  (void)depth_image;
#endif
#if !KEEP_HITS
  (void)last_transmittance;
  (void)stream_ends;
  (void)pool;
  (void)pool_capacity;
#endif
  const RsCamera camera = camera_argument;
  const int px = get_global_id(0) * PACKET_WIDTH;
  const int band_y = get_global_id(1) * PACKET_HEIGHT;
  const int py = band_y + tile_row * TILE;
  if (px >= camera.width || py >= camera.height) return;
  const uint tile = band_y / TILE * tiles_x + px / TILE;
  const uint begin = offsets[tile];
  const uint end = offsets[tile + 1];

  Packet p;
  p.X = ((float)px + RS_LANE_X + 0.5f - camera.cx) / camera.fx;
  p.Y = ((float)py + RS_LANE_Y + 0.5f - camera.cy) / camera.fy;
  p.T = (fv)(1.0f);
  p.R = p.G = p.B = (fv)(0.0f);
  p.T_last = (fv)(1.0f);
  p.hits = (iv)(0);
  p.alive = RS_MASK(RS_LANE_X + (float)px < (float)camera.width) &
            RS_MASK(RS_LANE_Y + (float)py < (float)camera.height);
#if WITH_DEPTH
  p.depth_sum = p.median = (fv)(0.0f);
#endif
  const float x0 = (px + 0.5f - camera.cx) / camera.fx;
  const float x1 = (px + PACKET_WIDTH - 0.5f - camera.cx) / camera.fx;
  const float y0 = (py + 0.5f - camera.cy) / camera.fy;
  const float y1 = (py + PACKET_HEIGHT - 0.5f - camera.cy) / camera.fy;

  StreamEnd stream;
  stream.chunk = RS_NO_CHUNK;
  stream.used = CHUNK;
  Pending pending;

  iv capped = (iv)(0);  // lanes that lost a hit to max_hits
  // Where the next pass continues (lexicographic in depth and reference), and the nearest dropped
  // hit.
  fv floor_key = (fv)(-1.0f);
  iv floor_reference = (iv)(-1);
  fv last_key = (fv)(-1.0f);
  iv last_reference = (iv)(-1);
  bool dropped;
  bool first_pass = true;
  do {
    dropped = false;
    fv limit_key = (fv)(INFINITY);
    iv limit_reference = (iv)(0x7fffffff);
    pending.head = pending.size = 0;
    uint block = begin;
    uint bits = 0;
    uint base = begin;
    for (;;) {
      // The next candidate whose box meets the packet's; k = end drains the list.
      while (bits == 0 && block < end) {
        base = block;
        const iv meets = RS_MASK(rs_load_float(boxes + block) <= x1) &
                         RS_MASK(rs_load_float(boxes + stride + block) <= y1) &
                         RS_MASK(rs_load_float(boxes + 2 * (size_t)stride + block) >= x0) &
                         RS_MASK(rs_load_float(boxes + 3 * (size_t)stride + block) >= y0);
        bits = rs_lane_bits(meets);
        if (end - block < PACKET) bits &= (1u << (end - block)) - 1u;
        block += PACKET;
      }
      const bool draining = bits == 0;
      uint k = end;
      float bound = INFINITY;
      float quantile = 0.0f;
      if (!draining) {
        k = base + rs_lowest_bit(bits);
        bits &= bits - 1;
        const float2 limit = limits[k];
        bound = limit.x;
        quantile = limit.y;
      }

      while (pending.head < pending.size &&
             (draining || rs_all(RS_MASK(pending.key[pending.head] <= bound)))) {
        const int h = pending.head++;
        const fv alpha = pending.alpha[h];
        iv active = RS_MASK(alpha > 0.0f) & p.alive;
        if (dropped) {
          const fv key = pending.key[h];
          active &= RS_MASK(key < limit_key) |
                    (RS_MASK(key == limit_key) & RS_MASK(pending.reference[h] < limit_reference));
        }
        if (!rs_any(active)) continue;
        capped |= active & RS_MASK(p.hits >= max_hits);
        active &= RS_MASK(p.hits < max_hits);
        last_key = select(last_key, pending.key[h], active);
        last_reference = select(last_reference, pending.reference[h], active);
        p.hits -= active;
        uint rest = rs_lane_bits(active);
        while (rest != 0) {
          const uint reference =
              ((__private const uint*)&pending.reference[h])[rs_lowest_bit(rest)];
          const iv mine = active & RS_MASK(pending.reference[h] == (iv)(reference));
          const uint lanes = rs_lane_bits(mine);
          rest &= ~lanes;
          __global const float* v = lines[reference >> 1].v;
          const fv a = select((fv)(0.0f), alpha, mine);
          const fv w = p.T * a;
          p.R += w * v[13];
          p.G += w * v[14];
          p.B += w * v[15];
          const fv after = p.T * (1.0f - a);
          p.T_last = select(p.T_last, p.T, mine);
#if WITH_DEPTH
          const PacketMeeting m = rs_meet(v, reference & 1, 0.0f, p.X, p.Y);
          const fv peak = m.along / m.direction2;
          p.depth_sum += w * select((fv)(0.0f), peak, mine);
          p.median = select(p.median, peak, mine & RS_MASK(p.T >= 0.5f) & RS_MASK(after < 0.5f));
#endif
          p.T = after;
#if KEEP_HITS
          stream_push(&stream, pool, pool_capacity, counters, reference, lanes);
#endif
        }
        p.alive &= RS_MASK(p.T >= min_transmittance) & ~capped;
      }
      if (draining || !rs_any(p.alive)) break;

      const uint reference = references[k];
      const bool general = reference & 1;
      __global const float* v = lines[reference >> 1].v;
      const PacketMeeting m = rs_meet(v, general, quantile, p.X, p.Y);
      iv hit = m.inside & p.alive;
      if (!rs_any(hit)) continue;
      const fv inverse = 1.0f / m.direction2;
      const fv distance2 = m.numerator * inverse;
      const fv peak = m.along * inverse;
#if PEAK_ORDER
      fv key = peak;
      hit &= RS_MASK(key >= 0.0f);
#else
      // Near root by Viete's formula from the far one: no difference of near equals.
      const fv far_root = peak + sqrt(fmax(quantile - distance2, (fv)(0.0f)) * inverse);
      fv key = (rs_origin_distance2(v, general) - quantile) * inverse / far_root;
      hit &= RS_MASK(key >= 0.0f) & RS_MASK(far_root > 0.0f);
#endif
      if (!first_pass) {
        hit &= RS_MASK(key > floor_key) |
               (RS_MASK(key == floor_key) & RS_MASK((iv)(reference) > floor_reference));
      }
      if (!rs_any(hit)) continue;
      fv alpha = select((fv)(0.0f), v[12] * rs_exp(-0.5f * distance2), hit);
      iv id = (iv)(reference);
      // Later passes keep misses behind every hit, so that a full list always makes progress.
      key = select(first_pass ? fmax(key, (fv)(bound)) : (fv)(INFINITY), key, hit);

      if (pending.size == PENDING) {
        if (pending.head > 0) {
          for (int i = pending.head; i < pending.size; ++i) {
            pending.key[i - pending.head] = pending.key[i];
            pending.alpha[i - pending.head] = pending.alpha[i];
            pending.reference[i - pending.head] = pending.reference[i];
          }
          pending.size -= pending.head;
          pending.head = 0;
        } else {
          // Full: the farther of the last entry and the newcomer leaves, lane by lane.
          const int last = PENDING - 1;
          const fv last_k = pending.key[last];
          const iv last_r = pending.reference[last];
          const iv nearer = RS_MASK(key < last_k) | (RS_MASK(key == last_k) & RS_MASK(id < last_r));
          const fv out_key = select(key, last_k, nearer);
          const fv out_alpha = select(alpha, pending.alpha[last], nearer);
          const iv out_id = select(id, last_r, nearer);
          const iv lost = RS_MASK(out_alpha > 0.0f) &
                          (RS_MASK(out_key < limit_key) |
                           (RS_MASK(out_key == limit_key) & RS_MASK(out_id < limit_reference)));
          limit_key = select(limit_key, out_key, lost);
          limit_reference = select(limit_reference, out_id, lost);
          dropped = dropped || rs_any(lost);
          key = select(last_k, key, nearer);
          alpha = select(pending.alpha[last], alpha, nearer);
          id = select(last_r, id, nearer);
          pending.size = last;
        }
      }
      int j = pending.size++;
      while (j > pending.head) {
        const fv other_key = pending.key[j - 1];
        const iv other_id = pending.reference[j - 1];
        const iv before =
            RS_MASK(key < other_key) | (RS_MASK(key == other_key) & RS_MASK(id < other_id));
        if (!rs_any(before)) break;
        const fv other_alpha = pending.alpha[j - 1];
        pending.key[j] = select(key, other_key, before);
        pending.alpha[j] = select(alpha, other_alpha, before);
        pending.reference[j] = select(id, other_id, before);
        key = select(other_key, key, before);
        alpha = select(other_alpha, alpha, before);
        id = select(other_id, id, before);
        --j;
      }
      pending.key[j] = key;
      pending.alpha[j] = alpha;
      pending.reference[j] = id;
    }
    floor_key = last_key;
    floor_reference = last_reference;
    first_pass = false;
  } while (dropped && rs_any(p.alive));

  const size_t plane = (size_t)camera.width * camera.height;
  rs_store_pixels(image, camera.width, camera.height, px, py, p.R + p.T * background.x);
  rs_store_pixels(image + plane, camera.width, camera.height, px, py, p.G + p.T * background.y);
  rs_store_pixels(image + 2 * plane, camera.width, camera.height, px, py, p.B + p.T * background.z);
  rs_store_pixels(image + 3 * plane, camera.width, camera.height, px, py, 1.0f - p.T);
#if WITH_DEPTH
  const fv weight = 1.0f - p.T;
  rs_store_pixels(depth_image, camera.width, camera.height, px, py,
                  select((fv)(0.0f), p.depth_sum / weight, RS_MASK(weight > 0.0f)));
  rs_store_pixels(depth_image + plane, camera.width, camera.height, px, py, p.median);
#if PACKET == 1
  rs_store_pixels(depth_image + 2 * plane, camera.width, camera.height, px, py, (float)p.hits);
#elif PACKET == 2
  rs_store_pixels(depth_image + 2 * plane, camera.width, camera.height, px, py,
                  convert_float2(p.hits));
#elif PACKET == 4
  rs_store_pixels(depth_image + 2 * plane, camera.width, camera.height, px, py,
                  convert_float4(p.hits));
#elif PACKET == 8
  rs_store_pixels(depth_image + 2 * plane, camera.width, camera.height, px, py,
                  convert_float8(p.hits));
#else
  rs_store_pixels(depth_image + 2 * plane, camera.width, camera.height, px, py,
                  convert_float16(p.hits));
#endif
#endif
#if KEEP_HITS
  const uint packets_x = (camera.width + PACKET_WIDTH - 1) / PACKET_WIDTH;
  stream_ends[(py / PACKET_HEIGHT) * packets_x + px / PACKET_WIDTH] =
      (uint2)(stream.chunk, stream.used);
  rs_store_pixels(last_transmittance, camera.width, camera.height, px, py, p.T_last);
  // The final transmittance is 1 - alpha of the image; the backward pass starts from T_last
  // instead.
#endif
  const uint capped_rays = popcount(rs_lane_bits(capped));
  if (capped_rays != 0) atomic_add(counters + 1, capped_rays);
#if PACKET == 1
  const uint hits = p.hits;
#else
  union {
    iv v;
    int s[PACKET];
  } lanes;
  lanes.v = p.hits;
  uint hits = 0;
  for (int i = 0; i < PACKET; ++i) hits += lanes.s[i];
#endif
  atomic_add(counters + 2, hits);
}
