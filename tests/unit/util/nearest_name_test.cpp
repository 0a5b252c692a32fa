// SPDX-License-Identifier: Apache-2.0
#include "util/nearest_name.hpp"

#include <doctest/doctest.h>

using namespace raysplats;

TEST_CASE("nearest name: misspellings find their name") {
  const std::vector<std::string> names{"iterations", "max-hits", "quantile", "seed", "sh-degree"};
  CHECK(nearest_name("iteratoins", names) == "iterations");
  CHECK(nearest_name("maxhits", names) == "max-hits");
  CHECK(nearest_name("quantil", names) == "quantile");
  CHECK(nearest_name("sed", names) == "seed");
  CHECK(nearest_name("seed", names) == "seed");
  CHECK(nearest_name("degree-sh", names) != "");
}

TEST_CASE("nearest name: edge cases") {
  CHECK(nearest_name("x", {}) == "");
  CHECK(nearest_name("", {"abc", "a"}) == "a");
  CHECK(nearest_name("abc", {"", "xyz1"}) == "");
  CHECK(nearest_name("b", {"a", "c"}) == "a");  // the first of equals
}
