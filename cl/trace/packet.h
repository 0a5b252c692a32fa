// SPDX-License-Identifier: Apache-2.0
// The unit of tracing: PACKET camera rays (a small block of pixels), one for each lane of a vector.
#ifndef RS_TRACE_PACKET_H
#define RS_TRACE_PACKET_H

#include "parallel/vector_lanes.h"
#include "shared/layout.h"

#define PACKET LANES

// Pixels of a packet and the place of every lane among them.
#if PACKET == 1
#define PACKET_WIDTH 1
#define PACKET_HEIGHT 1
#define RS_LANE_X (0.0f)
#define RS_LANE_Y (0.0f)
#elif PACKET == 2
#define PACKET_WIDTH 2
#define PACKET_HEIGHT 1
#define RS_LANE_X ((fv)(0, 1))
#define RS_LANE_Y ((fv)(0, 0))
#elif PACKET == 4
#define PACKET_WIDTH 2
#define PACKET_HEIGHT 2
#define RS_LANE_X ((fv)(0, 1, 0, 1))
#define RS_LANE_Y ((fv)(0, 0, 1, 1))
#elif PACKET == 8
#define PACKET_WIDTH 4
#define PACKET_HEIGHT 2
#define RS_LANE_X ((fv)(0, 1, 2, 3, 0, 1, 2, 3))
#define RS_LANE_Y ((fv)(0, 0, 0, 0, 1, 1, 1, 1))
#elif PACKET == 16
#define PACKET_WIDTH 4
#define PACKET_HEIGHT 4
#define RS_LANE_X ((fv)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3))
#define RS_LANE_Y ((fv)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3))
#endif

// A row of pixels of a packet stored to or loaded from an image plane; `width` and `height` bound
// the image.
void rs_store_pixels(__global float* plane, int width, int height, int x, int y, fv value) {
#if PACKET == 1
  if (x < width && y < height) plane[(size_t)y * width + x] = value;
#else
  union {
    fv v;
    float s[PACKET];
  } lanes;
  lanes.v = value;
  for (int j = 0; j < PACKET_HEIGHT && y + j < height; ++j) {
    for (int i = 0; i < PACKET_WIDTH && x + i < width; ++i) {
      plane[(size_t)(y + j) * width + x + i] = lanes.s[j * PACKET_WIDTH + i];
    }
  }
#endif
}

fv rs_load_pixels(__global const float* plane, int width, int height, int x, int y) {
#if PACKET == 1
  return x < width && y < height ? plane[(size_t)y * width + x] : 0.0f;
#else
  union {
    fv v;
    float s[PACKET];
  } lanes;
  lanes.v = (fv)(0.0f);
  for (int j = 0; j < PACKET_HEIGHT && y + j < height; ++j) {
    for (int i = 0; i < PACKET_WIDTH && x + i < width; ++i) {
      lanes.s[j * PACKET_WIDTH + i] = plane[(size_t)(y + j) * width + x + i];
    }
  }
  return lanes.v;
#endif
}

#ifndef LENS
#define LENS RS_LENS_PINHOLE
#endif

// Tangent coordinates of the packet whose first pixel is (x, y), and the lanes that see something.
typedef struct {
  fv X, Y;
  iv valid;
} PacketRays;

PacketRays rs_packet_rays(const RsCamera* camera,
                          __global const float* tangents,
                          const int x,
                          const int y) {
  PacketRays rays;
  rays.valid = RS_MASK(RS_LANE_X + (float)x < (float)camera->width) &
               RS_MASK(RS_LANE_Y + (float)y < (float)camera->height);
#if LENS
  const size_t plane = (size_t)camera->width * camera->height;
  rays.X = rs_load_pixels(tangents, camera->width, camera->height, x, y);
  rays.Y = rs_load_pixels(tangents + plane, camera->width, camera->height, x, y);
  rays.valid &= RS_MASK(rays.X == rays.X);
  rays.X = select((fv)(0.0f), rays.X, rays.valid);
  rays.Y = select((fv)(0.0f), rays.Y, rays.valid);
#else
  (void)tangents;
  rays.X = ((float)x + RS_LANE_X + 0.5f - camera->cx) / camera->fx;
  rays.Y = ((float)y + RS_LANE_Y + 0.5f - camera->cy) / camera->fy;
#endif
  return rays;
}

// Whether the launch for one face of a lens traces tile `tile` of the picture.
bool rs_on_face(__global const RsLensTile* tiles, const int face, const uint tile) {
#if LENS
  return tiles[tile].face == face;
#else
  (void)tiles;
  (void)face;
  (void)tile;
  return true;
#endif
}

// How the packet's rays pass a Gaussian. The last three are s^2 times what they are called, with s
// of rs_unit2().
typedef struct {
  iv inside;      // squared whitened distance of the line at most Q
  fv numerator;   // ||o' x d'||^2 = squared distance times <d', d'>
  fv direction2;  // <d', d'>
  fv along;       // -<o', d'>
} PacketMeeting;

// v: the line; X, Y: tangent coordinates of the rays (d = (X, Y, 1) in camera axes, t is depth
// along z).
PacketMeeting rs_meet_projective(__global const float* v, float quantile, fv X, fv Y) {
  PacketMeeting m;
  const fv dx = X - v[0];
  const fv dy = Y - v[1];
  const fv across = v[3] * dx + v[4] * dy;
  const fv upright = v[5] * dy;
  m.numerator = across * across + upright * upright;
  const fv toward = 1.0f + v[6] * dx + v[7] * dy;
  m.direction2 = toward * toward + v[8] * m.numerator;
  m.along = v[2] * toward;
  m.inside = RS_MASK(m.numerator <= quantile * m.direction2);
  return m;
}

// The residual vector is formed before its norm (docs/model.md).
PacketMeeting rs_meet_general(__global const float* v, float quantile, fv X, fv Y) {
  PacketMeeting m;
  const fv d0 = v[0] * X + v[1] * Y + v[2];
  const fv d1 = v[3] * X + v[4] * Y + v[5];
  const fv d2 = v[6] * X + v[7] * Y + v[8];
  m.direction2 = d0 * d0 + d1 * d1 + d2 * d2;
  m.along = -(v[9] * d0 + v[10] * d1 + v[11] * d2);
  const fv peak = m.along / m.direction2;
  const fv r0 = v[9] + peak * d0;
  const fv r1 = v[10] + peak * d1;
  const fv r2 = v[11] + peak * d2;
  m.numerator = (r0 * r0 + r1 * r1 + r2 * r2) * m.direction2;
  m.inside = RS_MASK(m.numerator <= quantile * m.direction2);
  return m;
}

PacketMeeting rs_meet(__global const float* v, bool general, float quantile, fv X, fv Y) {
  return general ? rs_meet_general(v, quantile, X, Y) : rs_meet_projective(v, quantile, X, Y);
}

// s^2: the square of the unit in which a line's numbers measure whitened space. That of the
// projective form makes ||o'|| equal to m_z.
float rs_unit2(__global const float* v, bool general) {
  return general ? 1.0f : v[2] * v[2] * v[8];
}

// s^2 |o'|^2: squared distance of the camera to the mean.
float rs_origin_distance2(__global const float* v, bool general) {
  return general ? v[9] * v[9] + v[10] * v[10] + v[11] * v[11] : v[2] * v[2];
}

#endif
