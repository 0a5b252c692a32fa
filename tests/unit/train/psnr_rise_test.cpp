// SPDX-License-Identifier: Apache-2.0
#include "train/psnr_rise.hpp"

#include <doctest/doctest.h>

#include "eval/metrics.hpp"

using namespace raysplats;

TEST_CASE("PSNR rise: it is judged when three views were seen again, at one size") {
  PsnrRise rise;
  for (const std::size_t view : {0u, 1u, 2u}) rise.note(view, 1, 20.0);
  rise.note(0, 2, 30.0);  // at half its size for the first time
  rise.note(0, 1, 20.0);
  rise.note(1, 1, 20.05);
  CHECK(!rise.most().has_value());
  CHECK(!rise.learned_nothing());
  rise.note(2, 1, 19.0);
  REQUIRE(rise.most().has_value());
  CHECK(*rise.most() == doctest::Approx(0.05));
  CHECK(rise.learned_nothing());
  rise.note(0, 2, 30.5);
  CHECK(*rise.most() == doctest::Approx(0.5));
  CHECK(!rise.learned_nothing());
}

TEST_CASE("PSNR rise: views that are perfect from the beginning are not judged") {
  PsnrRise rise;
  for (int pass = 0; pass < 3; ++pass) {
    for (const std::size_t view : {0u, 1u, 2u}) rise.note(view, 1, kMostPsnr);
  }
  CHECK(!rise.most().has_value());
  CHECK(!rise.learned_nothing());
  for (int pass = 0; pass < 2; ++pass) {
    for (const std::size_t view : {3u, 4u, 5u}) rise.note(view, 1, 20.0);
  }
  CHECK(rise.learned_nothing());
}
