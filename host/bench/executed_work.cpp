// SPDX-License-Identifier: Apache-2.0
// Instructions per unit of work. Of vectors of 16 floats: as executed, found by stepping through
// PoCL 3.1's machine code of AVX-512 kernels in a debugger, and its blocks by what
// cl/trace/work_tally.h counts; what is parked or shifted by the code alone, half vectors as
// halves. Of waves of 32: in clang 22's assembly of the same blocks for gfx1100, loops by their
// trips. What moves in order is cl/*/work.h's.
#include "bench/executed_work.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "parallel/work.h"
#include "raysplats/error.hpp"
#include "trace/work.h"
#include "train/work.h"

namespace raysplats {
namespace {

constexpr double kWave = 32;
constexpr double kLine = 64;
constexpr double kDigits = 256;  // of a pass of the sort: lines that are written side by side

KernelWork times(double count, const KernelWork& unit) {
  KernelWork out = unit;
  for (double* part :
       {&out.vectors, &out.scalars, &out.slow, &out.shifted, &out.parked, &out.lines, &out.runs,
        &out.chases, &out.tiled, &out.stores, &out.local, &out.atomics, &out.trips, &out.barriers})
    *part *= count;
  return out;
}

KernelWork moved(double bytes, double footprint) {
  return {.bytes = bytes, .footprint = footprint};
}

KernelWork sort_work(const ExecutedCounts& c, double pairs, double passes) {
  const KernelWork pair = c.grouped ? KernelWork{.vectors = 140 / kWave,
                                                 .scalars = 40 / kWave,
                                                 .local = 24 / kWave,
                                                 .trips = 4 / kWave,
                                                 .barriers = 27.0 / 1536}
                                    : KernelWork{.vectors = 1.5, .scalars = 7.2, .stores = 1};
  KernelWork out =
      times(passes * pairs, pair) + moved(passes * RS_WORK_SORT_PASS_BYTES * pairs, 2 * 8 * pairs);
  out.targets = kDigits * kLine;
  out.launches = 3 * passes;
  out.shared = 2 * passes;  // the scan of a few numbers between them is not worth sharing
  return out;
}

KernelWork prepare_work(const ExecutedCounts& c) {
  const double further = c.sh - 1;
  const KernelWork gaussian =
      c.grouped
          ? KernelWork{.vectors = (940 + 40 * further) / kWave,
                       .scalars = (200 + 5 * further) / kWave,
                       .slow = 20 / kWave,
                       .local = (100 + 6 * further) / kWave,
                       .trips = (8 + 0.2 * further) / kWave,
                       .barriers = (8 + 0.4 * further) / kWave}
          : KernelWork{.vectors = 55.5 + 0.6 * further, .scalars = 21, .slow = 1.4, .parked = 8.3};
  const double bytes = (RS_WORK_PREPARE_BYTES + RS_WORK_SH_BYTES * c.sh) * c.gaussians;
  KernelWork out = times(c.gaussians, gaussian) + moved(bytes, bytes);
  out.launches = out.shared = 1;
  return out;
}

KernelWork lists_work(const ExecutedCounts& c) {
  const KernelWork gaussian = c.grouped ? KernelWork{.vectors = 600 / kWave,
                                                     .scalars = 110 / kWave,
                                                     .slow = 14 / kWave,
                                                     .trips = 6 / kWave}
                                        : KernelWork{.vectors = 23, .scalars = 10, .slow = 0.5};
  // Neighbours in a wave have different numbers of tiles: half of the lanes wait.
  const KernelWork candidate = c.grouped ? KernelWork{.vectors = (2 * 70 + 64) / kWave,
                                                      .scalars = (2 * 20 + 46) / kWave,
                                                      .lines = 1,
                                                      .trips = 3 / kWave}
                                         : KernelWork{.vectors = 33, .scalars = 74, .lines = 1};
  KernelWork out =
      times(c.gaussians, gaussian) + times(c.candidates, candidate) +
      moved(RS_WORK_LIST_GAUSSIAN_BYTES * c.gaussians + RS_WORK_LIST_BYTES * c.candidates,
            96 * c.gaussians + 40 * c.candidates) +
      sort_work(c, c.candidates, c.sort_passes);
  out.table = 96 * c.gaussians;
  out.launches += 5;
  out.shared += 2;
  return out;
}

KernelWork forward_work(const ExecutedCounts& c, bool keep) {
  KernelWork out;
  if (c.grouped) {
    out =
        times(c.boxes, {.vectors = 45, .scalars = 38, .local = 3, .trips = 1, .barriers = 3}) +
        times(c.rounds, {.vectors = 90, .scalars = 70, .local = 10, .trips = 1, .barriers = 4}) +
        times(c.ordered, {.vectors = 9, .scalars = 3, .local = 1}) +
        times(c.tested, {.vectors = 49, .scalars = 18, .slow = 1, .local = 3, .trips = 2}) +
        times(c.opened,
              {.vectors = 152, .scalars = 85, .slow = 2, .local = 12, .trips = 3, .barriers = 1}) +
        times(c.compared, {.vectors = 20, .scalars = 18, .local = 4}) +
        times(c.packets, {.vectors = 150, .scalars = 60, .trips = 3});
    if (keep) out = out + times(c.opened, {.vectors = 36, .scalars = 27, .local = 2, .trips = 1});
  } else {
    const KernelWork tested = c.peak_order ? KernelWork{.vectors = 74, .scalars = 56, .slow = 1}
                                           : KernelWork{.vectors = 90, .scalars = 56, .slow = 3};
    out = times(c.boxes, {.vectors = 14, .scalars = 12}) +
          times(c.rounds, {.vectors = 5, .scalars = 30}) +
          times(c.ordered, {.vectors = 3, .scalars = 9}) + times(c.tested, tested) +
          times(c.found, {.vectors = 3, .scalars = 13}) +
          times(c.opened, {.vectors = 38, .scalars = 52}) +
          times(c.compared, {.vectors = 12, .scalars = 12}) +
          times(c.packets, {.vectors = 250, .scalars = 550});
    if (keep)
      out = out + times(c.opened, {.vectors = 11, .scalars = 50}) +
            times(c.packets, {.vectors = 90, .scalars = 200});
  }
  // A tile's packets share its lines and lists, which come from memory once.
  out.lines = c.candidates;
  out.table = kLine * c.gaussians;
  const double lists = (RS_WORK_FORWARD_CANDIDATE_BYTES - kLine) * c.candidates;
  out = out + moved(lists + RS_WORK_FORWARD_PIXEL_BYTES * c.pixels + (keep ? c.stream_bytes : 0),
                    lists + (keep ? c.stream_bytes : 0));
  out.launches = out.shared = c.grouped ? 2 : 1;
  return out;
}

KernelWork backward_work(const ExecutedCounts& c) {
  KernelWork out = c.grouped ? times(c.opened, {.vectors = 367,
                                                .scalars = 120,
                                                .slow = 8,
                                                .local = 36,
                                                .atomics = 13,
                                                .trips = 3,
                                                .barriers = 5}) +
                                   times(c.windows, {.vectors = 33, .scalars = 17, .local = 4}) +
                                   times(c.packets, {.vectors = 150, .scalars = 40, .trips = 3})
                             : times(c.opened, {.vectors = 247, .scalars = 117, .slow = 5}) +
                                   times(c.windows, {.vectors = 6, .scalars = 5}) +
                                   times(c.packets, {.vectors = 250, .scalars = 550});
  // Of a tile the first packet that meets a Gaussian fetches its line and its sums, which go back.
  const double met = c.tested > 0 ? std::min(1.0, c.opened / c.tested) : 1.0;
  out.lines = 3 * met * c.candidates;
  out.table = 3 * kLine * c.gaussians;
  out = out +
        moved(RS_WORK_BACKWARD_PIXEL_BYTES * c.pixels + c.stream_bytes + 2 * kLine * c.gaussians,
              c.stream_bytes);
  // Sums of segments, of long streams alone, are not counted.
  out.launches = out.shared = c.grouped ? 6 : 2;
  return out;
}

KernelWork finalize_work(const ExecutedCounts& c) {
  const double further = c.sh - 1;
  const KernelWork gaussian = c.grouped ? KernelWork{.vectors = (1023 + 93 * further) / kWave,
                                                     .scalars = (228 + 12 * further) / kWave,
                                                     .slow = 15 / kWave,
                                                     .local = (170 + 12 * further) / kWave,
                                                     .trips = (12 + 0.5 * further) / kWave,
                                                     .barriers = (21 + further) / kWave}
                                        : KernelWork{.vectors = 146 + 1.8 * further,
                                                     .scalars = 26,
                                                     .slow = 1.2,
                                                     .parked = 14 + 0.2 * further};
  // Two private copies on CPUs: read, summed into one, the other left at zero.
  const double bytes =
      (RS_WORK_FINALIZE_BYTES + (c.grouped ? 0 : 3 * kLine) + 2 * RS_WORK_SH_BYTES * c.sh) *
      c.gaussians;
  KernelWork out = times(c.gaussians, gaussian) + moved(bytes, bytes);
  out.launches = out.shared = 1;
  return out;
}

// Groups: half as many as operations counted by hand, because most are fused, and half as many
// again for addresses and edges.
KernelWork loss_work(const ExecutedCounts& c, bool value) {
  const KernelWork pixel =
      c.grouped ? (value ? KernelWork{.vectors = 600 / kWave,
                                      .scalars = 150 / kWave,
                                      .slow = 3 / kWave,
                                      .local = 260 / kWave,
                                      .trips = 8 / kWave,
                                      .barriers = 15 / kWave}
                         : KernelWork{.vectors = 330 / kWave,
                                      .scalars = 90 / kWave,
                                      .local = 130 / kWave,
                                      .trips = 8 / kWave,
                                      .barriers = 6 / kWave})
                : (value ? KernelWork{.vectors = 37.5, .scalars = 17, .slow = 0.19, .shifted = 7.5}
                         : KernelWork{.vectors = 18.4, .scalars = 21, .shifted = 5.6});
  const double bytes =
      value ? (c.grouped ? RS_WORK_GROUP_LOSS_VALUE_BYTES : RS_WORK_LOSS_VALUE_BYTES)
            : (c.grouped ? RS_WORK_GROUP_LOSS_GRADIENT_BYTES : RS_WORK_LOSS_GRADIENT_BYTES);
  KernelWork out = times(c.pixels, pixel) + moved(bytes * c.pixels, bytes * c.pixels);
  // Of planes that tiles read in rows: u and v, for the derivatives of SSIM as well.
  if (!c.grouped) out.tiled = (value ? 24 : 60) * c.pixels / kLine;
  out.launches = out.shared = value ? 2 : 1;
  return out;
}

KernelWork adam_work(const ExecutedCounts& c) {
  const double parameters = (RS_WORK_PARAMETERS + 3 * c.sh) * c.gaussians;
  const KernelWork parameter = c.grouped
                                   ? KernelWork{.vectors = 110 / kWave,
                                                .scalars = 35 / kWave,
                                                .slow = 4 / kWave,
                                                .trips = 2 / kWave}
                                   : KernelWork{.vectors = 1.35, .scalars = 0.6, .slow = 0.125};
  KernelWork out =
      times(parameters, parameter) + moved(RS_WORK_ADAM_BYTES * parameters, 20 * parameters);
  out.launches = out.shared = 2;
  return out;
}

KernelWork rays_work(const ExecutedCounts& c) {
  KernelWork out =
      c.grouped ? times(c.ray_nodes / kWave, {.vectors = 160, .scalars = 55, .trips = 3}) +
                      times(c.ray_blocks / kWave,
                            {.vectors = 150, .scalars = 40, .slow = 1, .trips = 3}) +
                      times(c.ray_hits / kWave,
                            {.vectors = 320, .scalars = 120, .slow = 1, .local = 40, .trips = 2})
                : times(c.ray_nodes, {.vectors = 40, .scalars = 110}) +
                      times(c.ray_blocks, {.vectors = 40, .scalars = 25}) +
                      times(c.ray_hits, {.vectors = 60, .scalars = 110, .slow = 0.2});
  // The next node is known from the last; the rest of it and the blocks lie in runs. Nodes are few:
  // one of 16 children for 256 Gaussians, or of 4 for 16.
  constexpr double kNodeLines = 6, kBlockLines = 15, kBlock = 60;
  out.runs = c.grouped ? 1.5 * c.ray_nodes + kBlockLines / 4 * c.ray_blocks
                       : (kNodeLines - 1) * c.ray_nodes + kBlockLines * c.ray_blocks;
  out.table = kBlock * c.gaussians;
  out.chases = c.grouped ? 0 : c.ray_nodes;
  out.path = kNodeLines * kLine / 256 * c.gaussians;
  out = out + moved(RS_WORK_RAY_BYTES * c.rays, RS_WORK_RAY_BYTES * c.rays);
  out.launches = out.shared = 1;
  return out;
}

}  // namespace

const std::vector<std::string>& modelled_rows() {
  static const std::vector<std::string> rows{
      "sort",     "prepare-view", "tile-lists",    "forward", "backward",
      "finalize", "loss-value",   "loss-gradient", "adam",    "rays"};
  return rows;
}

KernelWork executed_work(const std::string& row, const ExecutedCounts& c) {
  if (row == "sort") return sort_work(c, c.gaussians, 4);
  if (row == "prepare-view") return prepare_work(c);
  if (row == "tile-lists") return lists_work(c);
  if (row == "forward") return forward_work(c, false);
  if (row == "forward-train") return forward_work(c, true);
  if (row == "backward") return backward_work(c);
  if (row == "finalize") return finalize_work(c);
  if (row == "loss-value") return loss_work(c, true);
  if (row == "loss-gradient") return loss_work(c, false);
  if (row == "adam") return adam_work(c);
  if (row == "rays") return rays_work(c);
  throw UsageError(fmt::format("The work of row '{}' is not counted", row));
}

}  // namespace raysplats
