// SPDX-License-Identifier: Apache-2.0
#include "train/model_source.hpp"

#include <doctest/doctest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "raysplats/error.hpp"
#include "train/train_config.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

struct TemporaryFolder {
  fs::path path =
      fs::temp_directory_path() / ("raysplats_model_source_" + std::to_string(::getpid()));
  TemporaryFolder() { fs::create_directories(path); }
  ~TemporaryFolder() { fs::remove_all(path); }
};

void save_model(const fs::path& run, const std::string& iteration) {
  fs::create_directories(run / "point_cloud" / iteration);
  std::ofstream(run / "point_cloud" / iteration / "point_cloud.ply") << "ply";
}

}  // namespace

TEST_CASE("a run folder means its newest saved model and its settings") {
  const TemporaryFolder folder;
  const fs::path run = folder.path / "run";
  save_model(run, "iteration_900");
  save_model(run, "iteration_1000");
  save_model(run, "iteration_12x");
  fs::create_directories(run / "point_cloud" /
                         "iteration_5000");  // interrupted before the file appeared
  CHECK_FALSE(find_model(run).trained.has_value());
  TrainOptions options;
  options.hit_order = HitOrder::kPeak;
  options.quantile = 9.5;
  options.adaptive_radius = false;
  options.background = "0.25,0.5,1";
  options.memory_budget = 17;
  options.downscale = 4.0;
  std::ofstream(run / "config.toml") << to_toml(options);

  for (const fs::path& named : {run, run / "point_cloud" / "iteration_1000" / "point_cloud.ply"}) {
    const ModelSource source = find_model(named);
    CHECK(source.ply == run / "point_cloud" / "iteration_1000" / "point_cloud.ply");
    CHECK(source.iteration == 1000);
    REQUIRE(source.trained.has_value());
    const TraceOptions trace = trace_options(source, true);
    CHECK(trace.hit_order == HitOrder::kPeak);
    CHECK(trace.quantile == 9.5f);
    CHECK_FALSE(trace.adaptive_radius);
    CHECK(trace.background == std::array<float, 3>{0.25f, 0.5f, 1.0f});
    CHECK(dataset_options(source).downscale == 4.0);
    CHECK(trace.memory_budget == std::size_t{17} << 20);
  }
  CHECK(is_run_folder(run));
  CHECK_FALSE(is_run_folder(folder.path));
}

TEST_CASE("a PLY from elsewhere has the tracer's defaults") {
  const TemporaryFolder folder;
  const fs::path ply = folder.path / "model.ply";
  std::ofstream(ply) << "ply";
  const ModelSource source = find_model(ply);
  CHECK(source.ply == ply);
  CHECK_FALSE(source.trained.has_value());
  CHECK(trace_options(source, true).quantile == TraceOptions{}.quantile);
}

TEST_CASE("nothing to load is an error") {
  const TemporaryFolder folder;
  CHECK_THROWS_AS(find_model(folder.path), DataError);
  CHECK_THROWS_AS(find_model(folder.path / "missing.ply"), DataError);
}
