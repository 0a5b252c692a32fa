// SPDX-License-Identifier: Apache-2.0
#include "run/run_folder.hpp"
#include "unit/temporary_directory.hpp"

#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
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

TEST_CASE("rows of an older metrics.csv stay when its run goes on") {
  const TemporaryDirectory folder;
  // Without the two columns that came later; the third row was cut off.
  std::ofstream(folder / "metrics.csv") << "iteration,seconds,loss,psnr,gaussians,it_per_s\n10,1.5,"
                                           "0.5,12,100,7\n20,3,0.4,13,100,7\n30,4";
  RunFolder run(folder.path());
  run.begin_metrics(30);
  std::ifstream stream(folder / "metrics.csv");
  const std::string text(std::istreambuf_iterator<char>(stream), {});
  CHECK(text ==
        "iteration,seconds,loss,psnr,gaussians,it_per_s,candidates,hits\n10,1.5,0.5,12,100,7,0,0\n"
        "20,3,0.4,13,100,7,0,0\n");
}
