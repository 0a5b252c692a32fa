// SPDX-License-Identifier: Apache-2.0
// Ranks on several machines, each of which has a copy of the run's folder.
#include <doctest/doctest.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "comm/thread_ranks.hpp"
#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/trainer.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

TEST_CASE("where folders of ranks say different things, all do what that of rank 0 asks for") {
  constexpr int kEnd = 20, kMiddle = 10;
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data", whole = folder.path() / "whole";
  make_photos(data, 24, 6, 1);
  TrainOptions options = short_training(kEnd);
  options.views_per_step = 2;
  options.validate_views = 1;
  options.max_gaussians = 300;
  options.densify_until = 0;
  options.checkpoint_every = kMiddle;
  options.keep_checkpoints = 9;
  Context first(test_device()), second(test_device());
  const std::array<Context*, 2> contexts{&first, &second};
  Trainer(first, load_dataset(data), options, whole).run(false);
  // From the end on, where the test view has been measured, and from a validation on. One of the
  // ranks does not know of either.
  struct Case {
    int from, forgetful;
  };
  for (const auto& [from, forgetful] : {Case{kEnd, 0}, Case{kMiddle, 1}}) {
    CAPTURE(from);
    std::array<fs::path, 2> runs;
    for (const int rank : {0, 1}) {
      fs::path& run = runs[static_cast<std::size_t>(rank)];
      run = folder.path() / (std::to_string(from) + "_" + std::to_string(rank));
      fs::copy(whole, run, fs::copy_options::recursive);
      if (from == kMiddle) fs::remove(run / "checkpoints/step_000000020.rsck");
      if (rank == forgetful) fs::remove(run / "metrics.json");
    }
    std::array<std::int64_t, 2> ends{};
    run_thread_ranks(2, [&](Communicator& ranks) {
      const auto rank = static_cast<std::size_t>(ranks.rank());
      Trainer trainer(*contexts[rank], load_dataset(data), options, runs[rank], false, &ranks);
      trainer.resume("latest");
      ends[rank] = trainer.run(false).iterations;
      // Met by a rank that is still in the run, this would be an error.
      ranks.all_gather(std::array<char, 3>{});
    });
    CHECK(ends[0] == kEnd);
    CHECK(ends[1] == kEnd);
    const nlohmann::json said = nlohmann::json::parse(std::ifstream(runs[0] / "metrics.json"));
    CHECK(said.at("evaluations").back().at("iteration") == kEnd);
    if (from == kEnd) continue;
    std::size_t validated = 0;
    for (const nlohmann::json& row : said.at("validations"))
      validated += row.at("iteration") == kMiddle ? 1 : 0;
    CHECK(validated == 1);
  }
}
