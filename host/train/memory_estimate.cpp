// SPDX-License-Identifier: Apache-2.0
#include "train/memory_estimate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>

#include "bvh/lbvh.hpp"
#include "light/path_memory.hpp"
#include "light/view_tracer.hpp"
#include "raysplats/error.hpp"
#include "raysplats/gaussians.hpp"
#include "shared/layout.h"
#include "shared/light_layout.h"
#include "trace/candidate_lists.hpp"
#include "trace/device_gaussians.hpp"
#include "trace/exact_sum.h"
#include "trace/gradient_sums.hpp"
#include "trace/hit_streams.hpp"
#include "trace/memory_shares.hpp"
#include "trace/packet_layout.hpp"
#include "trace/ray_backward.hpp"
#include "trace/ray_launch.hpp"
#include "trace/ray_tree.hpp"
#include "trace/stream_segments.hpp"
#include "train/density/density_plan.hpp"
#include "util/mebibytes.hpp"

namespace raysplats {
namespace {

// Bytes of a pixel in the nine planes of SSIM's derivatives in one buffer
// (train/loss/image_loss.cpp).
constexpr std::size_t kSsimPlaneBytes = 9 * sizeof(float);

// How gradients of packets are added, with as few copies as there may be.
GradientSumChoice packet_sums(const TrainOptions& options,
                              std::size_t gaussians,
                              const DeviceInfo& device) {
  return GradientSumChoice::of(options.trace, device, gaussians,
                               MemoryShares(options.trace, device).packet_gradients(), 1);
}

// What views that are traced ray by ray hold per Gaussian, and in their largest buffer.
struct RayShare {
  std::size_t bytes = 0;
  std::size_t largest = 0;
};

RayShare rays_per_gaussian(const TrainOptions& options,
                           std::size_t gaussians,
                           const DeviceInfo& device) {
  const TreeForm form = tree_form(device);
  const GradientSumChoice choice =
      RayBackward::sum_choice(options.trace, device, gaussians, options.sh_degree);
  const std::size_t lines =
      RayBackward::sum_lines(options.sh_degree) * sizeof(GradientSums::Line) * choice.copies;
  const std::size_t exact = choice.sum == GradientSum::kExact ? lines * RS_EXACT_WORDS : 0;
  const std::size_t block =
      sizeof(float) * RayTree::block_floats(of_bare_rays(options.trace), form);
  // Box, tree, record.
  return {sizeof(RsAabb) + Lbvh::bytes_per_box(form) + block + 64 + lines + exact,
          std::max({lines, exact, block})};
}

// Rays of one launch, with results, gradients and the order in which they are traced, forward and
// backward; with mirrors those that are reflected as well. Few meet more than one.
std::size_t ray_bytes(const TrainOptions& options, std::size_t pixels, const DeviceInfo& device) {
  constexpr std::size_t segment =
      sizeof(Ray) + sizeof(RayResult) + 2 * sizeof(RayBackward::ResultGradient);
  constexpr std::size_t order = 2 * RayOrder::kBytesPerRay;
  const std::size_t mirrors =
      options.mirrors.empty() ? 0 : sizeof(RsSurfaceHit) + sizeof(std::uint32_t);
  const bool reflects = mirrors > 0 && options.mirror_bounces > 0;
  const std::size_t reflected = reflects ? segment + mirrors + sizeof(RsPath) : 0;
  const std::size_t rays = std::min(pixels, ViewTracer::batch(options.trace, device));
  return rays * (segment + order + mirrors + reflected);
}

// What the packets of a view hold at most beside the records of Gaussians: streams of hits, lists
// of tiles, and the copies of gradient lines but one.
std::size_t packet_bytes(const TrainOptions& options,
                         const MemoryDemand& demand,
                         const DeviceInfo& device) {
  const MemoryShares shares(options.trace, device);
  const PacketLayout packet = packet_layout(device, options.trace);
  // Each hit in a row of its own (and those of packets that start again are few), and a quarter
  // more for views to come.
  const std::size_t beside =
      packet.grouped ? StreamSegments::chunk_bytes(packet.lanes) / HitStreams::kChunkRows : 0;
  const std::size_t row =
      sizeof(std::uint32_t) * (2 + static_cast<std::size_t>(packet.lanes)) + beside;
  const std::size_t hits = demand.pixels * static_cast<std::size_t>(options.trace.max_hits);
  // Tiles along the side of a square picture.
  const auto side = static_cast<std::size_t>(
      std::ceil(std::sqrt(static_cast<double>(demand.pixels)) / packet.tile));
  const std::size_t pairs = demand.gaussians * side * side;
  const GradientSum sum = options.trace.gradient_sum;
  const bool copied =
      sum == GradientSum::kCopies || (sum == GradientSum::kAuto && device.type == DeviceType::kCpu);
  const std::size_t copies =
      copied ? GradientSumChoice::kPacketCopies * std::max<std::size_t>(device.compute_units, 1) - 1
             : 0;
  const std::size_t line = demand.gaussians * sizeof(RsLine);
  // As many copies as the share holds, but those that take less than exact sums stay beyond it.
  return std::min(shares.hit_streams(), hits / 4 * 5 * row) +
         std::min(shares.tile_lists(),
                  CandidateLists::with_headroom(pairs) * CandidateLists::kBytesPerCandidate) +
         std::max(std::min(shares.packet_gradients(), copies * line),
                  (packet_sums(options, demand.gaussians, device).copies - 1) * line);
}

}  // namespace

MemoryEstimate estimate_memory(const TrainOptions& options,
                               const MemoryDemand& demand,
                               const DeviceInfo& device) {
  const auto sh = 3 * static_cast<std::size_t>(sh_coefficients(options.sh_degree));
  const std::size_t floats = 3 + 4 + 3 + 1 + sh;
  constexpr std::size_t kScreen = GaussianGradients::kScreenNumbers;
  const std::size_t exact =
      packet_sums(options, demand.gaussians, device).sum == GradientSum::kExact
          ? 16 * RS_EXACT_WORDS * sizeof(std::uint32_t)
          : 0;
  MemoryEstimate out;
  // Parameters, gradients, two moments, gradients on the screen and statistics of density
  // control; while the set changes the new parameters, their sources and roles, later the mean
  // of the parameters in their place; the least scales.
  const std::size_t footprint = options.footprint > 0 ? 1 : 0;
  out.gaussians = demand.gaussians * (floats * 5 + kScreen + kDensityStatistics + 2 + footprint) *
                  sizeof(float);
  // What of the model lies within the box, while that is measured.
  if (options.bounds) out.gaussians += demand.gaussians * floats * sizeof(float);
  // Steps of several views: sums of gradients, one for every level of their tree.
  const auto views = static_cast<std::size_t>(options.views_per_step);
  out.gaussians +=
      demand.gaussians * (floats + kScreen) * std::bit_width(views - 1) * sizeof(float);
  // Line, gradient line and its exact sums, bounds, box, candidate keys and values with their
  // second copies.
  const bool packets = demand.ray_views < demand.views || demand.views == 0;
  const std::size_t record =
      2 * sizeof(RsLine) + exact + sizeof(RsViewBounds) + sizeof(RsAabb) + 44;
  if (packets) out.tracing = demand.gaussians * record;
  // Image, gradient, depth, 15 planes of the loss, a photo that found no room (two where the next
  // one comes meanwhile) and its floats at half the size.
  const std::size_t photo = demand.photo_words * sizeof(std::uint32_t);
  const std::size_t passing = device.type == DeviceType::kCpu ? 1 : 2;
  out.images =
      std::min(static_cast<std::size_t>(options.image_budget) * kMiB,
               demand.pixels * (demand.views * photo + demand.depth_maps * sizeof(float))) +
      demand.pixels * (passing * photo +
                       (25 + (options.exposure ? 4 : 0) + (options.background == "sky" ? 8 : 0)) *
                           sizeof(float));
  // Depth, its gradient, and a map that found no room. Lists of sparse points are small.
  if (options.depth_weight > 0)
    out.images += demand.pixels * (4 + (demand.depth_maps > 0 ? 1 : 0)) * sizeof(float);
  // A tracer that looks for what moves, and the photo without that.
  if (options.leave_out_moving) {
    if (packets) out.tracing += demand.gaussians * record;
    out.images += demand.pixels * (photo + sizeof(float));
  }
  if (packets) out.hits = packet_bytes(options, demand, device);
  // Moments of all parameters lie in one buffer.
  std::size_t largest = std::max({floats * sizeof(float), sizeof(RsLine), packets ? exact : 0});
  if (demand.ray_views > 0) {
    const RayShare share = rays_per_gaussian(options, demand.gaussians, device);
    out.rays = demand.gaussians * share.bytes + ray_bytes(options, demand.pixels, device) +
               mesh_bytes(demand.triangles, tree_form(device));
    largest = std::max(largest, share.largest);
  }
  out.largest_buffer =
      std::max(demand.gaussians * largest, demand.pixels * std::max(kSsimPlaneBytes, photo));
  return out;
}

bool fits(const MemoryEstimate& estimate, const DeviceInfo& device) {
  return estimate.total() <= usable_memory(device) &&
         estimate.largest_buffer <= device.max_allocation;
}

std::size_t gaussians_that_fit(const TrainOptions& options,
                               const MemoryDemand& demand,
                               const DeviceInfo& device) {
  MemoryDemand trial = demand;
  std::size_t low = 0, high = demand.gaussians;
  while (low < high) {
    trial.gaussians = high - (high - low) / 2;
    if (fits(estimate_memory(options, trial, device), device)) {
      low = trial.gaussians;
    } else {
      high = trial.gaussians - 1;
    }
  }
  return low;
}

void check_memory(const TrainOptions& options,
                  const MemoryDemand& demand,
                  const DeviceInfo& device) {
  const MemoryEstimate estimate = estimate_memory(options, demand, device);
  if (fits(estimate, device)) return;
  const std::size_t most = gaussians_that_fit(options, demand, device);
  const std::string remedy =
      most > 0 ? fmt::format(
                     "--max-gaussians {} would fit, more with a lower --sh-degree, "
                     "--memory-budget or --image-budget",
                     most)
               : "lower --memory-budget or --image-budget, or raise --downscale";
  throw ResourceError(fmt::format(
      "Training up to {} Gaussians needs about {:.0f} MiB ({:.0f} for Gaussians, {:.0f} for "
      "tracing, {:.0f} for rays one by one, {:.0f} for images, {:.0f} for hits; {:.0f} in the "
      "largest buffer) but {} has {:.0f} MiB, of "
      "which a run may take nine tenths, and {:.0f} MiB in one buffer: {}",
      demand.gaussians, mib(estimate.total()), mib(estimate.gaussians), mib(estimate.tracing),
      mib(estimate.rays), mib(estimate.images), mib(estimate.hits), mib(estimate.largest_buffer),
      device.name, mib(device.global_memory), mib(device.max_allocation), remedy));
}

}  // namespace raysplats
