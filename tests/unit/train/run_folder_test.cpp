// SPDX-License-Identifier: Apache-2.0
#include "train/run_folder.hpp"

#include <doctest/doctest.h>

#include <vector>

using namespace raysplats;

namespace {

EvaluationRow row(std::int64_t iteration, double psnr, std::size_t views) {
  EvaluationRow out;
  out.iteration = iteration;
  out.psnr = psnr;
  out.views = views;
  return out;
}

}  // namespace

TEST_CASE("a run that ends below its best evaluation is told, unless that saw other views") {
  CHECK_FALSE(better_before(std::vector<EvaluationRow>{}).has_value());
  CHECK_FALSE(better_before(std::vector{row(10, 20, 3)}).has_value());
  CHECK_FALSE(better_before(std::vector{row(10, 20.05, 3), row(20, 20, 3)}).has_value());
  CHECK_FALSE(better_before(std::vector{row(10, 25, 2), row(20, 20, 3)}).has_value());
  const auto best = better_before(std::vector{row(5, 21, 3), row(10, 23, 3), row(20, 20, 3)});
  REQUIRE(best.has_value());
  CHECK(best->iteration == 10);
}
