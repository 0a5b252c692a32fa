// SPDX-License-Identifier: Apache-2.0
// Records of views and cameras that kernels and host share; *_layout.h hold the others. Only 4-byte
// scalars and arrays of them, explicit padding, so that every compiler lays them out alike; the
// layout_probe kernel and a test compare both sides.
#ifndef RS_SHARED_LAYOUT_H
#define RS_SHARED_LAYOUT_H

#include "shared/compat.h"

// Axis-aligned box. Empty (never met by a ray) when lo > hi.
typedef struct {
  rs_float lo[3];
  rs_float hi[3];
} RsAabb;
RS_STATIC_ASSERT_SIZE(RsAabb, 24);

// What one view needs of one Gaussian, one cache line (docs/model.md, "The camera line").
// Projective form: x0 y0 m_z p | q r e_x e_y | kappa, three of no meaning | opacity r g b.
// General form: whitening matrix in camera axes, rows M0 M1 M2 (9), whitened origin o' (3), opacity
// r g b.
typedef struct {
  rs_float v[16];
} RsLine;
RS_STATIC_ASSERT_SIZE(RsLine, 64);

#define RS_LINE_HIDDEN 0      // no ray of this view meets it
#define RS_LINE_PROJECTIVE 1  // mean well in front of the camera
#define RS_LINE_GENERAL 2     // mean beside or behind the camera plane

// Culling record of one Gaussian in one view.
typedef struct {
  rs_float x0, y0, x1, y1;  // box of the outline in tangent coordinates X = x/z, Y = y/z
  rs_float depth;           // no hit is nearer than this
  rs_float quantile;  // Q of this Gaussian (smaller than the option when the radius is adaptive)
  rs_int kind;        // RS_LINE_*
  rs_int padding;
} RsViewBounds;
RS_STATIC_ASSERT_SIZE(RsViewBounds, 32);

// The power of the growth of its outline by which a Gaussian becomes fainter whose axes are raised
// to RsCamera::footprint: 1 would keep what it adds to all pixels together, were it alone. Those of
// trained models lie on each other, and together show less than the sum (docs/experiments.md). Half
// of it is taken by roots in view_footprint.h.
#define RS_FOOTPRINT_POWER 1.25f

// Pinhole camera of one view. Camera axes: x right, y down, z forward.
typedef struct {
  rs_float rotation[9];  // world to camera, row-major
  rs_float center[3];    // world
  rs_float fx, fy, cx, cy;
  rs_int width, height;
  rs_float near_depth;  // Gaussians whose mean is nearer along z are skipped; 0 = off
  rs_float footprint;   // least standard deviation per unit of depth, or of distance around
} RsCamera;
RS_STATIC_ASSERT_SIZE(RsCamera, 80);

// What decides how large a pixel of one view is at a point.
typedef struct {
  rs_float rotation[9];  // world to camera, row-major
  rs_float center[3];    // world
  rs_float low[2];  // of x/z and y/z that the picture shows, with a margin (RS_FOOTPRINT_DEPTH)
  rs_float high[2];
  rs_float spacing;  // size of a pixel at unit depth or distance, or anywhere
  rs_int kind;       // RS_FOOTPRINT_*
  rs_int padding[2];
} RsFootprintView;
RS_STATIC_ASSERT_SIZE(RsFootprintView, 80);

#define RS_FOOTPRINT_DEPTH 0     // grows with depth, seen within the limits: pinholes and lenses
#define RS_FOOTPRINT_DISTANCE 1  // grows with distance, seen all around: fisheye, panorama
#define RS_FOOTPRINT_CONSTANT 2  // the same everywhere: orthographic

// Camera of any model with a lens, and the sample that is taken of it.
typedef struct {
  rs_float rotation[9];  // world to camera, row-major
  rs_float center[3];    // world
  rs_float fx, fy, cx, cy;
  rs_float k1, k2, k3, k4, p1, p2;
  rs_float limit;        // radius (OpenCV) or angle (fisheye) up to which the lens is defined
  rs_float image_limit;  // its image, in normalised image coordinates
  rs_float aperture;     // radius of the lens, 0 = none
  rs_float focus_distance;
  rs_int width, height;
  rs_uint sample;
  rs_uint seed_lo, seed_hi;
} RsLensCamera;
RS_STATIC_ASSERT_SIZE(RsLensCamera, 124);

// A tile of a picture taken through a lens, seen by the pinhole of one face of a cube around the
// camera (cl/trace/lens_tiles.cl).
typedef struct {
  rs_float x0, y0, x1, y1;  // box of its rays in tangent coordinates of the face; x0 > x1: no ray
  rs_int face;
  rs_float cosine;  // least of its rays to the axis of the face
  rs_int padding[2];
} RsLensTile;
RS_STATIC_ASSERT_SIZE(RsLensTile, 32);

// Faces of that cube: the first looks forward.
#define RS_FACES 6

typedef struct {
  rs_float rows[RS_FACES]
               [9];  // camera axes to the axes of the faces; the last row of each is its axis
} RsLensFaces;
RS_STATIC_ASSERT_SIZE(RsLensFaces, 216);

// How the rays of a camera with a centre get to their places in the image plane, and what its
// depths and near limits are: the build constant LENS.
#define RS_LENS_PINHOLE 0  // by the grid of a pinhole; depths along z
#define RS_LENS_AXIAL 1    // read from a buffer that lens_tiles.cl made; depths along z
#define RS_LENS_AROUND 2   // the same of one that looks around: distances along its rays

#define RS_CAMERA_PINHOLE 0
#define RS_CAMERA_OPENCV 1
#define RS_CAMERA_FISHEYE 2
#define RS_CAMERA_EQUIRECTANGULAR 3
#define RS_CAMERA_ORTHOGRAPHIC 4

#endif
