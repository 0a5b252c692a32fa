// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "bench/speed_model.hpp"

namespace raysplats {

/// What one view of a model, and rays through it, gave kernels to do, as kernels that count it
/// found (cl/trace/work_tally.h).
struct ExecutedCounts {
  bool grouped = false;  ///< the form of GPUs: packets of 32 rays are waves; else vectors of 16
  double gaussians = 0;
  double sh = 1;  ///< coefficients of a Gaussian
  double pixels = 0;
  double packets = 0;
  double candidates = 0;  ///< (tile, Gaussian) pairs
  double hits = 0;        ///< (ray, Gaussian) pairs blended
  double sort_passes = 0;
  double stream_bytes = 0;
  /// RS_TALLY_* of a view that keeps its hits.
  double boxes = 0, tested = 0, found = 0, opened = 0, compared = 0, rounds = 0, ordered = 0,
         windows = 0;
  double rays = 0;
  double ray_hits = 0;
  double ray_nodes = 0, ray_blocks = 0;  ///< tested; groups: the most of 32 rays, times 32
  bool peak_order = false;
};

/// The work of a row of run_bench(), or of "forward-train" and "iteration". Throws UsageError for
/// rows that are not in modelled_rows().
KernelWork executed_work(const std::string& row, const ExecutedCounts& counts);

const std::vector<std::string>& modelled_rows();

}  // namespace raysplats
