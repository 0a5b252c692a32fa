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
  CHECK(nearest_name("--max-hit", {"--max-hits", "--mask"}) == "--max-hits");
  CHECK(nearest_name("epochs", names) == "");  // nothing that could be meant
  CHECK(nearest_name("fvo", {"fov", "width"}) == "fov");
  CHECK(nearest_name("--run", {"--q"}) == "");
  CHECK(nearest_name("--iter", {"--exit", "--iterations"}) == "--iterations");
  CHECK(nearest_name("--white-background", {"--background", "--sh-degree"}) == "--background");
  CHECK(nearest_name("--depth", {"--depth-weight", "--depth-unit"}) == "--depth-unit");
}

TEST_CASE("nearest name: edge cases") {
  CHECK(nearest_name("x", {}) == "");
  CHECK(nearest_name("", {"abc", "a"}) == "a");
  CHECK(nearest_name("abc", {"uvw", "xyz1"}) == "");
  CHECK(nearest_name("b", {"a", "c"}) == "a");  // the first of equals
}

TEST_CASE("did you mean: the nearest name, a few names, or what is said otherwise") {
  const std::vector<std::string> few{"glass", "mirror", "wood"};
  CHECK(did_you_mean("miror", few) == ": did you mean 'mirror'?");
  CHECK(did_you_mean("concrete", few) == ": use 'glass', 'mirror' or 'wood'");
  CHECK(did_you_mean("concrete", {"glass"}) == ": use 'glass'");
  CHECK(did_you_mean("concrete", {"", "glass", "", "wood", "glass"}) == ": use 'glass' or 'wood'");
  CHECK(did_you_mean("concrete", {}, ": there is none") == ": there is none");
  std::vector<std::string> many;
  for (int i = 0; i < 40; ++i) many.push_back("another " + std::to_string(i));
  CHECK(did_you_mean("concrete", many, ": see the list") == ": see the list");
  many.push_back("concert");
  CHECK(did_you_mean("concrete", many) == ": did you mean 'concert'?");
}
