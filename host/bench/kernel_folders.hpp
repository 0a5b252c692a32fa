// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "bench/bench.hpp"
#include "bench/compare.hpp"
#include "raysplats/context.hpp"

namespace raysplats {

/// One result of both folders' kernels on one scene.
struct ResultDifference {
  std::string name;  ///< "random/10000: image"
  std::size_t numbers = 0;
  std::size_t differing = 0;  ///< of them, in any bit
  double largest = 0;         ///< difference over the largest number; NaN where one is no number
};

/// Both sides' numbers of a result.
ResultDifference difference_of(std::string name,
                               std::span<const float> before,
                               std::span<const float> after);

struct KernelComparison {
  std::vector<ResultDifference> results;
  BenchComparison rows;
  /// Names of the timed rows that yield something besides, which is not compared.
  std::vector<std::string> uncompared;

  bool equal() const;
};

/// Compares the kernels of two folders like cl/: first pictures, gradients and parameters after a
/// step on every scene (with sums in the same order every time), then the time of every row, in
/// turns within one process. `context_options` are those of both contexts but for the folder.
/// Throws DeviceError for a folder that lacks a kernel or has one that does not compile, UsageError
/// as run_bench().
KernelComparison compare_kernels(const DeviceInfo& device,
                                 const ContextOptions& context_options,
                                 const std::string& folder,
                                 const std::string& other,
                                 const BenchOptions& options);

/// Fixed-width text.
std::string kernel_comparison_table(const KernelComparison& comparison);

}  // namespace raysplats
