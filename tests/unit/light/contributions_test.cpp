// SPDX-License-Identifier: Apache-2.0
#include "raysplats/contributions.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <numeric>
#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/model.hpp"
#include "raysplats/model_changes.hpp"
#include "raysplats/tracer.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;

namespace {

/// A small nearly opaque disc before a larger one, which hides in front of the camera, and a faint
/// small one beside them.
Gaussians discs() {
  Gaussians model;
  model.resize(3);
  model.means = {0, 0, 0, 0, 0, 2, 3, 0, 0};
  const float near = 0.0f, hidden = -1.0f, faint = -1.2f;
  model.log_scales = {near, near, -3, hidden, hidden, -3, faint, faint, -3};
  model.opacities = {9, 5, 0};
  return model;
}

}  // namespace

TEST_CASE("contributions are the shares of light that make up a picture's alpha") {
  Context context(test_device());
  TraceOptions trace;
  trace.background = {0.3f, 0.2f, 0.1f};
  const Gaussians model = discs();
  const std::vector<Camera> cameras{look_at({0, 0, -6}, {0, 0, 0}, {0, -1, 0}, 60, 40, 50.0),
                                    look_at({0, 0.5, -7}, {0, 0, 0}, {0, -1, 0}, 30, 30, 40.0)};
  const std::vector<double> found = contributions(context, model, cameras, trace);
  REQUIRE(found.size() == 3);
  // What the Gaussians give together is what the background does not.
  Tracer tracer(context, trace);
  const Model on_device(context, model);
  double alpha = 0;
  for (const Camera& camera : cameras) {
    const Image picture = tracer.render(on_device, camera);
    double sum = 0;
    for (std::size_t i = 0; i < picture.pixels(); ++i)
      sum += static_cast<double>(picture.data[4 * i + 3]);
    alpha += sum / static_cast<double>(picture.pixels() * cameras.size());
  }
  CHECK(std::accumulate(found.begin(), found.end(), 0.0) == doctest::Approx(alpha).epsilon(1e-4));
  CHECK(found[0] > found[1]);
  CHECK(found[1] < found[2]);
  CHECK(found[2] > 1e-4);

  // From anywhere the hidden disc is worth more than the faint one.
  ModelChanges changes;
  changes.max_gaussians = 2;
  CHECK(changed(model, changes).opacities == std::vector<float>{9, 5});
  changes.contributions = found;
  CHECK(changed(model, changes).opacities == std::vector<float>{9, 0});
  // They are those of the model that comes in, not of what is left.
  changes.crop = Bounds{{-10, -10, -10}, {10, 10, 1}};
  changes.max_gaussians = 1;
  CHECK(changed(model, changes).opacities == std::vector<float>{9});
  changes.contributions.pop_back();
  CHECK_THROWS_AS(changed(model, changes), UsageError);
  CHECK_THROWS_AS(contributions(context, model, {}, trace), UsageError);
}

TEST_CASE("contributions of many and large views are those of fewer and smaller ones") {
  Context context(test_device());
  const Gaussians model = discs();
  const Camera large = look_at({0, 0, -6}, {0, 0, 0}, {0, -1, 0}, 1200, 800, 1000.0);
  const std::vector<double> one = contributions(context, model, std::vector{large}, {});
  const std::vector<double> many =
      contributions(context, model, std::vector<Camera>(100, downscaled(large, 8.0)), {});
  for (std::size_t i = 0; i < 3; ++i) CHECK(many[i] == doctest::Approx(one[i]).epsilon(0.03));
}

TEST_CASE("contributions can be stopped, and hear how far they are") {
  Context context(test_device());
  const std::vector<Camera> cameras(3, look_at({0, 0, -6}, {0, 0, 0}, {0, -1, 0}, 60, 40, 50.0));
  double last = 0;
  const auto listen = [&](double share) {
    CHECK(share >= last);
    last = share;
    return true;
  };
  const std::vector<double> expected = contributions(context, discs(), cameras, {});
  CHECK(contributions(context, discs(), cameras, {}, {}, listen) == expected);
  CHECK(last == doctest::Approx(1.0));
  const auto second_view = [](double share) { return share < 0.5; };
  CHECK(contributions(context, discs(), cameras, {}, {}, second_view).empty());
}
