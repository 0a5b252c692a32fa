// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <filesystem>
#include <string>

#include "program.hpp"

/// A data set of a few small photos, made once.
inline const std::string& tiny_data() {
  static const TemporaryFolder folder;
  static const std::string data = [] {
    const std::string path = folder / "data";
    const Outcome outcome = raysplats_program(
        {"generate", path, "--size", "32", "--train-views", "6", "--test-views", "1", "-q"});
    REQUIRE(outcome.code == 0);
    return path;
  }();
  return data;
}

constexpr int kIterations = 30;

/// Thirty iterations into `run`, with density control and a checkpoint after every fifth.
inline Words tiny_training(const std::string& run) {
  return {"train",
          tiny_data(),
          "-o",
          run,
          "-n",
          std::to_string(kIterations),
          "--init-count",
          "300",
          "--max-gaussians",
          "600",
          "--sh-degree",
          "1",
          "--densify-from",
          "8",
          "--densify-every",
          "8",
          "--checkpoint-every",
          "5",
          "--resolution-schedule",
          "12",
          "--deterministic",
          "-q"};
}

inline std::string checkpoint_of(const std::string& run, int iteration) {
  std::string number = std::to_string(iteration);
  number.insert(0, 9 - number.size(), '0');
  return (std::filesystem::path(run) / "checkpoints" / ("step_" + number + ".rsck")).string();
}

inline std::string model_of(const std::string& run, int iteration = kIterations) {
  return (std::filesystem::path(run) / "point_cloud" / ("iteration_" + std::to_string(iteration)) /
          "point_cloud.ply")
      .string();
}

/// The final model and checkpoint of two runs are the same files, byte for byte.
inline bool same_result(const std::string& a, const std::string& b) {
  const std::string model = read_file(model_of(a));
  const std::string state = read_file(checkpoint_of(a, kIterations));
  return !model.empty() && !state.empty() && model == read_file(model_of(b)) &&
         state == read_file(checkpoint_of(b, kIterations));
}

/// A run that nothing disturbed, made once.
inline const std::string& undisturbed() {
  static const TemporaryFolder folder;
  static const std::string run = [] {
    const std::string path = folder / "run";
    const Outcome outcome = raysplats_program(tiny_training(path));
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    return path;
  }();
  return run;
}

/// A copy of the undisturbed run without what its last iterations left: its newest checkpoint is
/// that of iteration 25.
inline void broken_off(const std::string& run) {
  std::filesystem::copy(undisturbed(), run, std::filesystem::copy_options::recursive);
  std::filesystem::remove(checkpoint_of(run, kIterations));
  std::filesystem::remove_all(std::filesystem::path(run) / "point_cloud");
  REQUIRE(std::filesystem::exists(checkpoint_of(run, 25)));
}

/// Temporary files anywhere below `folder`.
inline std::size_t temporaries(const std::filesystem::path& folder) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    count += contains(entry.path().filename().string(), ".tmp") ? 1 : 0;
  return count;
}
