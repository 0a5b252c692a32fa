// SPDX-License-Identifier: Apache-2.0
#include "bench/summary.hpp"

#include <doctest/doctest.h>

using namespace raysplats;

TEST_CASE("summary: median, deviation and ends") {
  const Summary none = summarize({});
  CHECK(none.samples == 0);
  CHECK(none.median == 0);
  const Summary one = summarize({3});
  CHECK(one.samples == 1);
  CHECK(one.median == 3);
  CHECK(one.deviation == 0);
  const Summary odd = summarize({5, 1, 100, 2, 4});
  CHECK(odd.samples == 5);
  CHECK(odd.median == 4);
  CHECK(odd.deviation == 2);  // of 3 2 0 1 96
  CHECK(odd.minimum == 1);
  CHECK(odd.maximum == 100);
  const Summary even = summarize({4, 1, 3, 2});
  CHECK(even.median == doctest::Approx(2.5));
  CHECK(even.deviation == doctest::Approx(1.0));  // of 1.5 0.5 0.5 1.5
}
