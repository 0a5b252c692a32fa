// SPDX-License-Identifier: Apache-2.0
// Runs that have to be the same run: resumed, or shared by ranks.
#pragma once

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <initializer_list>
#include <numbers>
#include <string>
#include <vector>

#include "comm/thread_ranks.hpp"
#include "raysplats/context.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/trainer.hpp"
#include "run/checkpoint.hpp"
#include "unit/fixture.hpp"
#include "unit/train/photographed.hpp"
#include "unit/train/short_training.hpp"

namespace raysplats {

/// Cameras all around coloured_cloud(), with square pictures of `size`.
inline std::vector<Camera> ring_around_cloud(int count, int size) {
  std::vector<Camera> out;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * i / count;
    out.push_back(look_at({4 * std::cos(angle), 4 * std::sin(angle), i % 2}, {0, 0, 0}, {0, 0, 1},
                          size, size, 1.1 * size));
  }
  return out;
}

/// Runs in `data.folder / "straight"`, and from each of these checkpoints: the same model, and the
/// same of what `told(folder)` gives of a run. Returns that model.
template <class Told>
Gaussians check_resumed(const Photographed& data,
                        TrainOptions options,
                        std::initializer_list<int> checkpoints,
                        const Told& told) {
  options.trace.deterministic = true;
  options.checkpoint_every = 20;
  options.keep_checkpoints = 99;
  Trainer straight(shared_test_context(), data.dataset, options, data.folder / "straight");
  straight.run(false);
  for (const int from : checkpoints) {
    INFO(from);
    const std::filesystem::path run = data.folder / std::to_string(from);
    Trainer resumed(shared_test_context(), data.dataset, options, run);
    resumed.resume(checkpoint_path(data.folder / "straight", from));
    resumed.run(false);
    CHECK(told(run) == told(data.folder / "straight"));
    check_equal(straight.model(), resumed.model());
  }
  return straight.model();
}

/// Runs in `data.folder / "alone"`, and by two ranks: the same model of each, and of the first one
/// the same of what `told(folder)` gives.
template <class Told>
void check_ranks(const Photographed& data, TrainOptions options, const Told& told) {
  options.trace.deterministic = true;
  options.views_per_step = 2;
  Context first(test_device()), second(test_device());
  const std::array<Context*, 2> contexts{&first, &second};
  Trainer alone(first, data.dataset, options, data.folder / "alone");
  alone.run(false);
  std::array<Gaussians, 2> models;
  run_thread_ranks(2, [&](Communicator& ranks) {
    const auto rank = static_cast<std::size_t>(ranks.rank());
    Trainer trainer(*contexts[rank], data.dataset, options, data.folder / std::to_string(rank),
                    false, &ranks);
    trainer.run(false);
    models[rank] = trainer.model();
  });
  CHECK(told(data.folder / "0") == told(data.folder / "alone"));
  for (const Gaussians& model : models) check_equal(alone.model(), model);
}

}  // namespace raysplats
