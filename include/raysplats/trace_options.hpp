// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace raysplats {

/// Depth that orders the hits of a ray (docs/model.md).
enum class HitOrder {
  kEntry,  ///< near root of the confidence ellipsoid; an origin inside or past it misses (the
           ///< paper)
  kPeak,   ///< depth of the maximum response; an origin inside is allowed
};

/// How the rays of a camera find the Gaussians they meet. Pictures and gradients are the same
/// within rounding, but for what TraceOptions::view_footprint says.
enum class Traversal {
  kAuto,   ///< tiles, or without a view_footprint what the device's tuning says; rays one by one
           ///< where tiles cannot be
  kTiles,  ///< packets of rays share the candidate list of their tile of the picture
  kBvh,    ///< every ray walks the bounding volume hierarchy (the paper)
};

/// What a packet of camera rays is made of.
enum class PacketShape {
  kAuto,      ///< the device's own: vectors on CPUs, elsewhere subgroups where its compiler makes
              ///< one of a packet, or groups; widths 32 and 64 are never vectors
  kVector,    ///< the lanes of a vector in one work-item
  kGroup,     ///< the work-items of a work-group, which share rows of hits in local memory
  kSubgroup,  ///< the same, with what they share going through functions of one subgroup
};

/// Function from the trained scale parameter to the standard deviation.
enum class ScaleActivation {
  kExp,      ///< exponential (3DGS)
  kSigmoid,  ///< 1 / (1 + exp(-x)), below 1 (the paper)
};

/// How the gradients that rays send to one Gaussian are added.
enum class GradientSum {
  kAuto,  ///< private copies on CPUs, exact where they do not fit; elsewhere atomic, or exact when
          ///< it has to be deterministic
  kCopies,  ///< one copy per worker, added in a fixed order; exact where they do not fit
  kExact,   ///< long integers: the same bits whatever the order, and with any number of workers
  kAtomic,  ///< shared floats: the last bits depend on the scheduling; added by the device's own
            ///< instruction where its compiler offers one, else as kSwap
  kSwap,    ///< shared floats, by compare-and-swap alone
};

/// Light from far away by direction, as spherical harmonics in world axes: R, G, B of each of the
/// (degree + 1)^2 coefficients in the order and with the signs of cl/shared/sh.h, degree 0 to 4. A
/// direction shows max(0, 0.5 + sum), as colours of Gaussians do.
using SkyLight = std::vector<std::array<float, 3>>;

/// Which Gaussians a ray meets, how it blends them, and how that is computed.
struct TraceOptions {
  float quantile =
      11.3449f;  ///< Q: a ray meets a Gaussian when the squared whitened distance is <= Q
  float min_transmittance = 1e-4f;        ///< a ray stops below this (epsilon_1)
  int max_hits = 512;                     ///< a ray stops after this many hits (K)
  HitOrder hit_order = HitOrder::kEntry;  ///< in which hits are blended
  bool adaptive_radius = false;  ///< Q shrinks where opacity * response would be below 1/255
  float near_depth =
      0.0f;  ///< Gaussians whose mean is nearer along the view axis are skipped; 0 = off
  /// Pictures show no axis of a Gaussian thinner than this share of their pixels: thinner ones are
  /// raised to it, and the opacity falls as the area of the outline grows (the screen filter of Yu
  /// et al. 2024, "Mip-Splatting"). Rays one by one, those of mirrors and scenes among them, are
  /// cones as wide as that, which agrees to first order. Their gradient is not known: pictures that
  /// are differentiated ray by ray have no footprint. 0 = off
  float view_footprint = 0.0f;
  std::array<float, 3> background{0.0f, 0.0f, 0.0f};  ///< colour behind everything
  SkyLight sky;  ///< behind everything in views of cameras, in place of `background`; empty: none
  Traversal traversal = Traversal::kAuto;  ///< of camera rays
  bool depth = false;  ///< camera rays also yield expected depth, median depth and hit count
  PacketShape packet_shape = PacketShape::kAuto;  ///< speed alone
  int packet_width = 0;  ///< rays of a packet: 1, 2, 4, 8, 16 in a vector, 8, 16, 32, 64 in a
                         ///< group; 0 = the device's own
  GradientSum gradient_sum = GradientSum::kAuto;  ///< of the backward pass
  bool deterministic = false;  ///< kAuto gives the same bits every time; on CPUs it always does
  /// The derivative of a colour that is clamped at 0 is 0. With this, gradients that would raise it
  /// pass all the same: training needs them.
  bool raise_clamped = false;
  /// What a ray blends of a Gaussian, T alpha, that the backward pass takes for nothing: it sums by
  /// how much the rays that meet a Gaussian blend more (GaussianGradients::screen).
  float least_weight = 0.0f;
  double launch_budget_ms = -1.0;  ///< of one launch; 0 = unbounded, -1 = the device's default
  std::size_t memory_budget = 0;   ///< bytes for hit lists and private gradients; 0 = a quarter
                                   ///< of the device's memory, from 1 to 4 GiB and no more than
                                   ///< two of its largest buffers
};

/// What models are trained with and shown by unless something else is said: the order of hits in
/// which standard viewers blend, ellipsoids no larger than what they show, and nothing thinner than
/// pixels can show.
inline TraceOptions peak_order() {
  TraceOptions options;
  options.hit_order = HitOrder::kPeak;
  options.adaptive_radius = true;
  options.view_footprint = 0.3f;
  return options;
}

}  // namespace raysplats
