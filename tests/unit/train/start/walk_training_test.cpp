// SPDX-License-Identifier: Apache-2.0
// Runs on photos of a long walk, whose cameras stand much farther apart than what they see.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/trainer.hpp"
#include "run/checkpoint.hpp"
#include "train/capture_geometry.hpp"
#include "unit/fixture.hpp"
#include "unit/train/photographed.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

constexpr int kPlaces = 240;
constexpr double kStep = 1.5, kAside = 3.0;  // between places, and to what they see

/// A hedge along the way.
Gaussians hedge() {
  Gaussians out = coloured_cloud(6000, 1.0, 8);
  for (std::size_t i = 0; i < out.size(); ++i) {
    out.means[3 * i] *= static_cast<float>(0.5 * kStep * (kPlaces + 2));
    out.means[3 * i + 1] += static_cast<float>(kAside + 1.0);
  }
  return out;
}

std::vector<Camera> walk() {
  std::vector<Camera> out;
  for (int i = 0; i < kPlaces; ++i) {
    const glm::dvec3 place(kStep * (i - 0.5 * (kPlaces - 1)), 0, 0);
    out.push_back(look_at(place, place + glm::dvec3(0, 1, 0), {0, 0, 1}, 40, 40, 28));
  }
  return out;
}

/// Photos of the hedge along the walk, and points that miss it by a little.
struct Walk : Photographed {
  Walk() : Photographed(hedge(), walk()) {
    CounterRng rng(5, 2);
    for (const float position : hedge().means) {
      dataset.points.positions.push_back(position + static_cast<float>(0.05 * rng.normal()));
      dataset.points.colors.push_back(0.5f);
    }
  }
};

}  // namespace

TEST_CASE("a long walk is learned in steps by what is near it, whatever its length") {
  const Walk data;
  const std::vector<Camera> cameras = walk();
  const double extent = camera_extent(cameras);
  const double motion = motion_extent(cameras, extent, data.dataset.points.positions);
  CHECK(motion > kAside);
  CHECK(motion < 2 * kAside);
  const auto trained = [&](double faster) {
    TrainOptions options = short_training(1200);
    options.init = "colmap";
    options.max_gaussians = 8000;
    options.position_lr = {5e-4 * faster, 2e-5 * faster};
    Trainer trainer(shared_test_context(), data.dataset, options,
                    data.folder / std::to_string(faster));
    return trainer.run(false).evaluations.back().psnr;
  };
  const double usual = trained(1), by_spread = trained(extent / motion);
  MESSAGE("by what is near " << usual << " dB, by the cameras' spread " << by_spread << " dB");
  CHECK(usual > by_spread + 1);
}

TEST_CASE("a long walk that is resumed goes on in the same steps") {
  const Walk data;
  TrainOptions options = short_training(20);
  options.init = "colmap";
  options.trace.deterministic = true;
  options.checkpoint_every = 10;
  options.keep_checkpoints = 9;
  Trainer straight(shared_test_context(), data.dataset, options, data.folder / "straight");
  straight.run(false);
  Trainer resumed(shared_test_context(), data.dataset, options, data.folder / "resumed");
  resumed.resume(checkpoint_path(data.folder / "straight", 10));
  resumed.run(false);
  check_equal(straight.model(), resumed.model());
}
