// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "bench/bench.hpp"
#include "bench/operation.hpp"

namespace raysplats {

using IdFilter = std::function<bool(const std::string&)>;

/// Whether an id ("row/scene/size") is wanted. Throws UsageError for what is no regular expression.
IdFilter id_filter(const std::string& expression);
std::string id_of(const std::string& row, const std::string& scene, std::size_t size);

/// Generated Gaussians that are measured.
struct BenchCase {
  std::string scene;
  std::size_t size;
};

/// Throws UsageError when the filter leaves no row.
void require_rows(const BenchOptions& options, const BenchModel* model);
/// The cases of the options, without those that the filter leaves no row; throws as require_rows().
std::vector<BenchCase> wanted_cases(const BenchOptions& options);
/// Its Gaussians and camera.
BenchModel generated(const BenchCase& one, const BenchOptions& options);

/// Without the stages that the filter leaves out, and the operations that have none left.
std::vector<BenchOperation> selected(std::vector<BenchOperation> operations,
                                     const IdFilter& keep,
                                     const std::string& scene,
                                     std::size_t size);

BenchRow row_of(const BenchStage& stage,
                const StageSamples& samples,
                const std::string& scene,
                std::size_t size);

/// Version, date, device and options; nothing that is measured.
BenchReport bench_header(const Context& context,
                         const BenchOptions& options,
                         const BenchModel* model);

}  // namespace raysplats
