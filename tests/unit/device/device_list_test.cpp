// SPDX-License-Identifier: Apache-2.0
#include "device/device_list.hpp"

#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "raysplats/error.hpp"

using namespace raysplats;

TEST_CASE("lists of devices are cut at commas that are in no name") {
  using List = std::vector<std::string>;
  const List names{"AMD Radeon RX 580 (POLARIS10, DRM 3.35.0, LLVM 10.0.0)", "cpu-haswell", "1,2"};
  const auto parts = [&](const std::string& list) { return device_selectors(list, names); };
  CHECK(parts("") == List{""});
  CHECK(parts("0") == List{"0"});
  CHECK(parts("0,1,0") == List{"0", "1", "0"});
  CHECK(parts("1,2") == List{"1", "2"});
  CHECK(parts("cpu,haswell") == List{"cpu", "haswell"});
  CHECK(parts("polaris10, drm") == List{"polaris10, drm"});
  CHECK(parts(names[0]) == List{names[0]});
  CHECK(parts("1," + names[0] + ",cpu-haswell") == List{"1", names[0], "cpu-haswell"});
  CHECK(parts("cpu-haswell,POLARIS10, DRM 3.35.0,0") ==
        List{"cpu-haswell", "POLARIS10, DRM 3.35.0", "0"});
  for (const char* list : {",", "0,", ",0", "0,,1", "cpu,,0", "POLARIS10,"}) {
    CAPTURE(list);
    CHECK_THROWS_AS(parts(list), UsageError);
  }
}
