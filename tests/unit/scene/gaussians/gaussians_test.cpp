// SPDX-License-Identifier: Apache-2.0
#include "raysplats/gaussians.hpp"

#include <doctest/doctest.h>

#include <numeric>

#include "raysplats/error.hpp"
#include "raysplats/model_changes.hpp"

using namespace raysplats;

namespace {

Gaussians numbered(int degree, std::size_t count) {
  Gaussians model;
  model.sh_degree = degree;
  model.resize(count);
  std::iota(model.means.begin(), model.means.end(), 1.0f);
  std::iota(model.sh.begin(), model.sh.end(), 1.0f);
  std::iota(model.opacities.begin(), model.opacities.end(), 1.0f);
  return model;
}

}  // namespace

TEST_CASE("gaussians: resize gives every group its length and new ones unit quaternions") {
  Gaussians model;
  model.sh_degree = 2;
  model.resize(3);
  CHECK(model.size() == 3);
  CHECK(model.means.size() == 9);
  CHECK(model.quaternions == std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  CHECK(model.log_scales.size() == 9);
  CHECK(model.sh.size() == 3 * 9 * 3);
  model.quaternions[4] = 0.5f;
  model.means[8] = 7.0f;
  model.resize(4);
  CHECK(model.quaternions[4] == 0.5f);
  CHECK(model.quaternions[12] == 1.0f);
  CHECK(model.means[8] == 7.0f);
  CHECK(model.means[11] == 0.0f);
  model.resize(1);
  CHECK(model.size() == 1);
  CHECK(model.sh.size() == 27);
  model.resize(0);
  CHECK(model.means.empty());
  CHECK(model.sh.empty());
}

TEST_CASE("gaussians: bands are added as zeros and dropped from the end") {
  for (int from = 0; from <= 4; ++from) {
    const Gaussians model = numbered(from, 3);
    for (int to = 0; to <= 4; ++to) {
      CAPTURE(from);
      CAPTURE(to);
      const Gaussians out = with_sh_degree(model, to);
      CHECK(out.sh_degree == to);
      CHECK(out.means == model.means);
      CHECK(out.opacities == model.opacities);
      const std::size_t a = 3 * static_cast<std::size_t>((from + 1) * (from + 1));
      const std::size_t b = 3 * static_cast<std::size_t>((to + 1) * (to + 1));
      REQUIRE(out.sh.size() == 3 * b);
      for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t k = 0; k < b; ++k)
          CHECK(out.sh[i * b + k] == (k < a ? model.sh[i * a + k] : 0.0f));
      }
    }
  }
  CHECK(with_sh_degree(numbered(3, 0), 1).sh.empty());
  CHECK_THROWS_AS(with_sh_degree(numbered(3, 1), -1), UsageError);
  CHECK_THROWS_AS(with_sh_degree(numbered(3, 1), 9), UsageError);
}

TEST_CASE("gaussians: what does not fit together is refused before it is changed") {
  ModelChanges turn;
  turn.rotate_degrees = {10, 0, 0};
  CHECK_NOTHROW(changed(numbered(1, 2), turn));
  Gaussians model = numbered(1, 2);
  model.quaternions.clear();
  CHECK_THROWS_AS(changed(model, turn), UsageError);
  model = numbered(1, 2);
  model.sh.pop_back();
  CHECK_THROWS_AS(changed(model, turn), UsageError);
  CHECK_THROWS_AS(with_sh_degree(model, 1), UsageError);
  model = numbered(1, 2);
  model.sh_degree = 3;
  CHECK_THROWS_AS(with_sh_degree(model, 2), UsageError);
}
