// SPDX-License-Identifier: Apache-2.0
#include "train/model_validator.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <vector>

#include "raysplats/device.hpp"
#include "reference/scenes.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;

namespace {

struct Fixture {
  Context context{test_device()};
  Gaussians model = reference::random_scene(70, 4, 1);
  Adam adam{context, {}};
  ModelValidator validator{context, {}};

  Fixture() { adam.initialize(model.size(), model.sh_degree); }
  std::string fault() {
    return validator.find_fault(DeviceGaussians::upload(context, model, ScaleActivation::kExp),
                                adam);
  }
};

}  // namespace

TEST_CASE("model validator: a sound model has no fault [small] [tiny]") {
  Fixture f;
  CHECK(f.fault().empty());
  f.model.resize(0);
  CHECK(f.fault().empty());
}

TEST_CASE("model validator: the first number that is not finite is named [small] [tiny]") {
  Fixture f;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  SUBCASE("mean") {
    f.model.means[3 * 17 + 2] = nan;
    f.model.means[3 * 60] = -infinity;
    CHECK(f.fault() == "2 numbers of 'means' are not finite, the first of them in Gaussian 17");
  }
  SUBCASE("the last number") {
    f.model.sh.back() = infinity;
    CHECK(f.fault() == "1 numbers of 'sh' are not finite, the first of them in Gaussian 69");
  }
  SUBCASE("moments") {
    std::vector<float> first(4 * 70, 0.0f);
    std::vector<float> second(4 * 70, 0.0f);
    second[4 * 3 + 1] = nan;
    f.adam.restore(ParameterGroup::kQuaternions, first, second);
    CHECK(f.fault() ==
          "1 numbers of 'second moments of quaternions' are not finite, the first of them in "
          "Gaussian 3");
  }
  SUBCASE("large and tiny numbers are finite") {
    f.model.opacities[5] = std::numeric_limits<float>::denorm_min();
    f.model.sh[5] = std::numeric_limits<float>::max();
    f.model.sh[6] = std::numeric_limits<float>::lowest();
    CHECK(f.fault().empty());
  }
}

TEST_CASE("model validator: the tree that rays walk is the one that is looked at [small]") {
  Fixture f;
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(f.context, f.model, ScaleActivation::kExp);
  RayTracer rays(f.context, {});
  CHECK(f.validator.find_fault(gaussians, f.adam, &rays).empty());
  CHECK(rays.tree().tree().size() == f.model.size());
  CHECK_FALSE(rays.follow(gaussians));  // it is up to date
  // A tree of other Gaussians that passes for theirs.
  Gaussians moved = f.model;
  for (float& mean : moved.means) mean += 100.0f;
  DeviceGaussians others = DeviceGaussians::upload(f.context, moved, ScaleActivation::kExp);
  others.revision = gaussians.revision;
  CHECK_FALSE(f.validator.find_fault(others, f.adam, &rays).empty());
}
