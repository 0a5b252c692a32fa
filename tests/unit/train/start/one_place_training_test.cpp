// SPDX-License-Identifier: Apache-2.0
// Runs on photos that were all taken from one place, as by a scanner's stations.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/gtc/constants.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/trainer.hpp"
#include "unit/fixture.hpp"
#include "unit/train/photographed.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

/// Gaussians on a sphere of radius `unit` around the origin.
Gaussians shell(double unit) {
  Gaussians out = coloured_cloud(400, 1.0, 7);
  for (std::size_t i = 0; i < out.size(); ++i) {
    float* mean = &out.means[3 * i];
    const auto length = static_cast<double>(std::hypot(mean[0], mean[1], mean[2]));
    for (std::size_t k = 0; k < 3; ++k) {
      mean[k] = static_cast<float>(unit * mean[k] / length);
      out.log_scales[3 * i + k] += static_cast<float>(std::log(0.5 * unit));
    }
  }
  return out;
}

/// All around the origin, each `step` from the last one.
std::vector<Camera> around(double step) {
  std::vector<Camera> out;
  for (int i = 0; i < 20; ++i) {
    const double angle = 0.1 * i * glm::pi<double>();
    const glm::dvec3 center(step * i, 0, 0);
    const glm::dvec3 ahead(std::cos(angle), std::sin(angle), 0.3 * std::sin(3 * angle));
    out.push_back(look_at(center, center + ahead, {0, 0, 1}, 32, 32, 24));
  }
  return out;
}

/// Photos of the shell, and points that miss it by a twentieth of the unit.
struct Station : Photographed {
  Station(double unit, double step) : Photographed(shell(unit), around(step)) {
    CounterRng rng(5, 2);
    for (const float position : shell(unit).means) {
      dataset.points.positions.push_back(position + static_cast<float>(0.05 * unit * rng.normal()));
      dataset.points.colors.push_back(0.5f);
    }
  }
};

double psnr_of(const Station& data, DensityStrategy strategy, const std::string& name) {
  TrainOptions options = short_training(150);
  options.init = "colmap";
  options.max_gaussians = 900;
  options.strategy = strategy;
  Trainer trainer(shared_test_context(), data.dataset, options, data.folder / name);
  return trainer.run(false).evaluations.back().psnr;
}

}  // namespace

TEST_CASE("means move where all photos are from one place, by parts of what they show") {
  for (const double unit : {1e-3, 1.0}) {
    CAPTURE(unit);
    const Station data(unit, 0.0);
    TrainOptions options = short_training(2000);
    options.init = "colmap";
    Trainer trainer(shared_test_context(), data.dataset, options, data.folder / "run");
    trainer.step();
    const Gaussians first = trainer.model();
    for (int i = 0; i < 20; ++i) trainer.step();
    const Gaussians last = trainer.model();
    REQUIRE(first.size() == last.size());
    double most = 0;
    for (std::size_t i = 0; i < first.means.size(); ++i)
      most = std::max(most, std::abs(static_cast<double>(last.means[i]) - first.means[i]));
    CHECK(most > 1e-3 * unit);
    CHECK(most < 0.1 * unit);
  }
}

TEST_CASE("photos from one place are learned in any unit and by any strategy") {
  const Station home(1.0, 1e-4), tiny(1e-3, 1e-7);
  const double budget = psnr_of(home, DensityStrategy::kBudget, "budget");
  const double small = psnr_of(tiny, DensityStrategy::kBudget, "budget");
  const double mcmc = psnr_of(home, DensityStrategy::kMcmc, "mcmc");
  MESSAGE("budget " << budget << " dB, a thousandth of the size " << small << " dB, mcmc " << mcmc
                    << " dB");
  CHECK(small > budget - 0.5);
  CHECK(mcmc > budget - 3.5);
}
