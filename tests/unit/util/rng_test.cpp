// SPDX-License-Identifier: Apache-2.0
#include "util/rng.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <set>
#include <vector>

using namespace raysplats;

TEST_CASE("counter rng: the value depends on seed, stream and counter alone") {
  CounterRng a(1, 2);
  std::vector<std::uint64_t> values;
  for (int i = 0; i < 100; ++i) values.push_back(a.bits());
  CHECK(a.counter() == 100);
  CounterRng resumed(1, 2, 40);
  for (std::size_t i = 40; i < 100; ++i) CHECK(resumed.bits() == values[i]);
  CHECK(std::set<std::uint64_t>(values.begin(), values.end()).size() == 100);
  CHECK(CounterRng(1, 3).bits() != values[0]);
  CHECK(CounterRng(2, 2).bits() != values[0]);
  CHECK(CounterRng(2, 1).bits() != values[0]);
  CHECK(CounterRng(0, 0).bits() != CounterRng(0, 0, 1).bits());
}

TEST_CASE("counter rng: uniform numbers fill the unit interval evenly") {
  CounterRng rng(7, 1);
  const int count = 100000;
  std::vector<int> bins(20, 0);
  double sum = 0;
  for (int i = 0; i < count; ++i) {
    const double u = rng.uniform();
    REQUIRE(u >= 0);
    REQUIRE(u < 1);
    sum += u;
    ++bins[static_cast<std::size_t>(u * 20)];
  }
  CHECK(std::abs(sum / count - 0.5) < 0.005);
  // Chi-square with 19 degrees of freedom stays below 43.8 in 999 of 1000 generators.
  double chi = 0;
  for (const int n : bins) chi += std::pow(n - count / 20.0, 2) / (count / 20.0);
  CHECK(chi < 43.8);
}

TEST_CASE("counter rng: integers stay below the bound and reach all values") {
  CounterRng rng(3, 1);
  std::set<std::uint64_t> seen;
  for (int i = 0; i < 500; ++i) seen.insert(rng.below(7));
  CHECK(seen.size() == 7);
  CHECK(*seen.rbegin() == 6);
  CHECK(rng.below(1) == 0);
}

TEST_CASE("counter rng: normal numbers have the moments of a standard normal") {
  CounterRng rng(5, 1);
  const int count = 100000;
  double m1 = 0, m2 = 0, m3 = 0, m4 = 0;
  for (int i = 0; i < count; ++i) {
    const double x = rng.normal();
    REQUIRE(std::isfinite(x));
    m1 += x;
    m2 += x * x;
    m3 += x * x * x;
    m4 += x * x * x * x;
  }
  CHECK(std::abs(m1 / count) < 0.015);
  CHECK(std::abs(m2 / count - 1) < 0.02);
  CHECK(std::abs(m3 / count) < 0.05);
  CHECK(std::abs(m4 / count - 3) < 0.15);
}
