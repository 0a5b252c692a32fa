// SPDX-License-Identifier: Apache-2.0
// Every record that kernels and host share, with its fields: what the layout_probe kernel and a
// test compare.
#ifndef RS_SHARED_RECORDS_H
#define RS_SHARED_RECORDS_H

#include "shared/layout.h"
#include "shared/light_layout.h"
#include "shared/ray_layout.h"
#include "shared/segment_layout.h"
#include "shared/trace_layout.h"
#include "shared/train_layout.h"

// clang-format off
#define RS_RECORDS(RECORD, FIELD) \
  RECORD(RsAabb) FIELD(RsAabb, lo) FIELD(RsAabb, hi) \
  RECORD(RsRay) FIELD(RsRay, origin) FIELD(RsRay, t_min) FIELD(RsRay, direction) \
    FIELD(RsRay, t_max) \
  RECORD(RsCone) FIELD(RsCone, width) FIELD(RsCone, spread) \
  RECORD(RsRayResult) FIELD(RsRayResult, color) FIELD(RsRayResult, alpha) \
    FIELD(RsRayResult, expected_depth) FIELD(RsRayResult, median_depth) FIELD(RsRayResult, hits) \
    FIELD(RsRayResult, capped) \
  RECORD(RsLine) FIELD(RsLine, v) \
  RECORD(RsViewBounds) FIELD(RsViewBounds, x0) FIELD(RsViewBounds, y0) FIELD(RsViewBounds, x1) \
    FIELD(RsViewBounds, y1) FIELD(RsViewBounds, depth) FIELD(RsViewBounds, quantile) \
    FIELD(RsViewBounds, kind) FIELD(RsViewBounds, padding) \
  RECORD(RsCamera) FIELD(RsCamera, rotation) FIELD(RsCamera, center) FIELD(RsCamera, fx) \
    FIELD(RsCamera, fy) FIELD(RsCamera, cx) FIELD(RsCamera, cy) FIELD(RsCamera, width) \
    FIELD(RsCamera, height) FIELD(RsCamera, near_depth) FIELD(RsCamera, footprint) \
  RECORD(RsFootprintView) FIELD(RsFootprintView, rotation) FIELD(RsFootprintView, center) \
    FIELD(RsFootprintView, low) FIELD(RsFootprintView, high) FIELD(RsFootprintView, spacing) \
    FIELD(RsFootprintView, kind) FIELD(RsFootprintView, padding) \
  RECORD(RsLensCamera) FIELD(RsLensCamera, rotation) FIELD(RsLensCamera, center) \
    FIELD(RsLensCamera, fx) FIELD(RsLensCamera, fy) FIELD(RsLensCamera, cx) \
    FIELD(RsLensCamera, cy) FIELD(RsLensCamera, k1) FIELD(RsLensCamera, k2) \
    FIELD(RsLensCamera, k3) FIELD(RsLensCamera, k4) FIELD(RsLensCamera, p1) \
    FIELD(RsLensCamera, p2) FIELD(RsLensCamera, limit) FIELD(RsLensCamera, image_limit) \
    FIELD(RsLensCamera, aperture) FIELD(RsLensCamera, focus_distance) FIELD(RsLensCamera, width) \
    FIELD(RsLensCamera, height) FIELD(RsLensCamera, sample) \
    FIELD(RsLensCamera, seed_lo) FIELD(RsLensCamera, seed_hi) \
  RECORD(RsLensTile) FIELD(RsLensTile, x0) FIELD(RsLensTile, y0) FIELD(RsLensTile, x1) \
    FIELD(RsLensTile, y1) FIELD(RsLensTile, face) FIELD(RsLensTile, cosine) \
    FIELD(RsLensTile, padding) \
  RECORD(RsLensFaces) FIELD(RsLensFaces, rows) \
  RECORD(RsSurfaceHit) FIELD(RsSurfaceHit, t) FIELD(RsSurfaceHit, u) FIELD(RsSurfaceHit, v) \
    FIELD(RsSurfaceHit, triangle) \
  RECORD(RsMaterial) FIELD(RsMaterial, kind) FIELD(RsMaterial, color) FIELD(RsMaterial, texture) \
    FIELD(RsMaterial, specular) FIELD(RsMaterial, roughness) FIELD(RsMaterial, ior) \
    FIELD(RsMaterial, absorption) FIELD(RsMaterial, opacity) FIELD(RsMaterial, emission) \
    FIELD(RsMaterial, shadow) \
  RECORD(RsTexture) FIELD(RsTexture, offset) FIELD(RsTexture, width) FIELD(RsTexture, height) \
    FIELD(RsTexture, padding) \
  RECORD(RsLight) FIELD(RsLight, kind) FIELD(RsLight, position) FIELD(RsLight, direction) \
    FIELD(RsLight, color) FIELD(RsLight, radius) FIELD(RsLight, padding) \
  RECORD(RsEnvironment) FIELD(RsEnvironment, color) FIELD(RsEnvironment, width) \
    FIELD(RsEnvironment, height) FIELD(RsEnvironment, right) FIELD(RsEnvironment, up) \
    FIELD(RsEnvironment, forward) FIELD(RsEnvironment, light) FIELD(RsEnvironment, padding) \
  RECORD(RsPath) FIELD(RsPath, skip) FIELD(RsPath, pixel) FIELD(RsPath, begin) \
    FIELD(RsPath, throughput) FIELD(RsPath, media) FIELD(RsPath, splits) FIELD(RsPath, lineage) \
    FIELD(RsPath, blind) FIELD(RsPath, direct) FIELD(RsPath, width) FIELD(RsPath, spread) \
  RECORD(RsSurface) FIELD(RsSurface, position) FIELD(RsSurface, material) \
    FIELD(RsSurface, shading) FIELD(RsSurface, entering) FIELD(RsSurface, normal) \
    FIELD(RsSurface, triangle) FIELD(RsSurface, color) FIELD(RsSurface, t) \
    FIELD(RsSurface, offset) FIELD(RsSurface, shadow_origin) \
  RECORD(RsWave) FIELD(RsWave, seed_lo) FIELD(RsWave, seed_hi) FIELD(RsWave, sample) \
    FIELD(RsWave, scatter) FIELD(RsWave, bounce) FIELD(RsWave, max_bounces) \
    FIELD(RsWave, min_throughput) FIELD(RsWave, indirect) FIELD(RsWave, ambient) \
    FIELD(RsWave, strength) FIELD(RsWave, bias) FIELD(RsWave, lights) \
    FIELD(RsWave, light_samples) FIELD(RsWave, first_pixel) \
  RECORD(RsAdam) FIELD(RsAdam, beta1) FIELD(RsAdam, rest1) FIELD(RsAdam, beta2) \
    FIELD(RsAdam, rest2) FIELD(RsAdam, epsilon) FIELD(RsAdam, root_scale) FIELD(RsAdam, rates) \
    FIELD(RsAdam, begin) FIELD(RsAdam, end) FIELD(RsAdam, rows) FIELD(RsAdam, padding) \
  RECORD(RsParts) FIELD(RsParts, first) \
  RECORD(RsLoss) FIELD(RsLoss, width) FIELD(RsLoss, height) FIELD(RsLoss, stride) \
    FIELD(RsLoss, plane) FIELD(RsLoss, planes) FIELD(RsLoss, composite) FIELD(RsLoss, red) \
    FIELD(RsLoss, green) FIELD(RsLoss, blue) FIELD(RsLoss, pixel_scale) FIELD(RsLoss, ssim_scale) \
    FIELD(RsLoss, alpha_scale) \
  RECORD(RsForward) FIELD(RsForward, window) FIELD(RsForward, background) \
    FIELD(RsForward, min_transmittance) FIELD(RsForward, max_hits) \
    FIELD(RsForward, pool_capacity) FIELD(RsForward, padding) \
  RECORD(RsBackward) FIELD(RsBackward, gaussians) FIELD(RsBackward, copies) \
    FIELD(RsBackward, tiles_x) FIELD(RsBackward, tile_row) FIELD(RsBackward, tile_rows) \
    FIELD(RsBackward, background) FIELD(RsBackward, screen_x) FIELD(RsBackward, screen_y) \
    FIELD(RsBackward, limit) FIELD(RsBackward, padding) \
  RECORD(RsFinalize) FIELD(RsFinalize, gaussians) FIELD(RsFinalize, copies) \
    FIELD(RsFinalize, screen_x) FIELD(RsFinalize, screen_y) \
  RECORD(RsRayWalk) FIELD(RsRayWalk, near) FIELD(RsRayWalk, background) \
    FIELD(RsRayWalk, quantile) FIELD(RsRayWalk, min_transmittance) FIELD(RsRayWalk, max_hits) \
    FIELD(RsRayWalk, sh_coefficients) FIELD(RsRayWalk, active_degree) \
    FIELD(RsRayWalk, color_from_origin) FIELD(RsRayWalk, has_cones) \
    FIELD(RsRayWalk, padding) \
  RECORD(RsRaySums) FIELD(RsRaySums, screen) FIELD(RsRaySums, gaussians) \
    FIELD(RsRaySums, limit) FIELD(RsRaySums, padding) \
  RECORD(RsStreamSegment) FIELD(RsStreamSegment, packet) FIELD(RsStreamSegment, chunk) \
    FIELD(RsStreamSegment, used) FIELD(RsStreamSegment, rows) FIELD(RsStreamSegment, number) \
    FIELD(RsStreamSegment, behind) FIELD(RsStreamSegment, front) FIELD(RsStreamSegment, slot) \
  RECORD(RsReachingRow) FIELD(RsReachingRow, row) FIELD(RsReachingRow, number)
// clang-format on

#endif
