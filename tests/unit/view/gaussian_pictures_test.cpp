// SPDX-License-Identifier: Apache-2.0
#include "view/gaussian_pictures.hpp"

#include <doctest/doctest.h>

#include <optional>

#include "raysplats/error.hpp"
#include "raysplats/model.hpp"
#include "trace/model_impl.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;
using namespace raysplats::view;

TEST_CASE("a point is found where a model has depths, and asked for in vain in a sentence") {
  Context context = make_test_context();
  Gaussians one;
  one.resize(1);
  one.opacities = {4.0f};
  one.log_scales = {-3.0f, -3.0f, -3.0f};
  one.sh.resize(3);
  const Model model(context, one);
  ViewRequest request;
  request.camera = look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 1, 1, 1.5);
  GaussianPictures plain(context, gaussians_of(model, context), {}, {});
  const std::optional<glm::dvec3> point = plain.point(request);
  REQUIRE(point);
  CHECK(point->z == doctest::Approx(0).epsilon(1e-5));
  Mirrors mirrors;
  mirrors.meshes.resize(1);
  GaussianPictures mirrored(context, gaussians_of(model, context), {}, mirrors);
  CHECK_THROWS_AS(mirrored.point(request), UsageError);
}
