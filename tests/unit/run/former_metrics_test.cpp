// SPDX-License-Identifier: Apache-2.0
#include "run/former_metrics.hpp"

#include <doctest/doctest.h>

#include <nlohmann/json.hpp>

using namespace raysplats;
using Json = nlohmann::json;

namespace {

// As a run writes it; that one reads other types of whole numbers is no matter.
Json metrics(int iteration, const char* device = "a device") {
  return {{"command", iteration == 10 ? "first" : "second"},
          {"complete", iteration > 10},
          {"iteration", iteration},
          {"iterations", 20},
          {"most_gaussians", 100},
          {"model_hash", "ab"},
          {"loss", 0.5},
          {"evaluation_seconds", 3.0},
          {"kernel_build_seconds", 2.0},
          {"peak_device_bytes", 1000 - iteration},
          {"device", device},
          {"timed_steps", 4},
          {"kernels", Json::array({{{"name", "a"}, {"calls", 4}, {"ms", 1.0}, {"share", 1.0}}})}};
}

}  // namespace

TEST_CASE("a run that goes on says what is true of all its parts") {
  Json former = metrics(10);
  former["kernels"].push_back({{"name", "b"}, {"calls", 2}, {"ms", 6.0}, {"share", 0.0}});
  const Json now = metrics(20);
  const Json all = continued_metrics(now, former, true);
  CHECK(all.at("command") == "first");
  CHECK(all.at("kernel_build_seconds") == 4.0);
  CHECK(all.at("peak_device_bytes") == 990);
  CHECK(all.at("timed_steps") == 8);
  REQUIRE(all.at("kernels").size() == 2);
  CHECK(all.at("kernels")[0].at("name") == "b");
  CHECK(all.at("kernels")[0].at("share") == 0.75);
  CHECK(all.at("kernels")[1].at("calls") == 8);
  CHECK(all.at("kernels")[1].at("ms") == 2.0);
  CHECK(all.at("iteration") == 20);

  // Times of another device are not those of this one.
  const Json moved = continued_metrics(now, metrics(10, "another"), true);
  CHECK(moved.at("timed_steps") == 4);
  CHECK(moved.at("kernels") == now.at("kernels"));
  CHECK(moved.at("command") == "first");
}

TEST_CASE("a run without a step says nothing anew of its steps") {
  Json former = metrics(20);
  former["complete"] = false;
  Json now = metrics(20, "another");
  now["loss"] = 0.0;
  now["kernels"] = Json::array();
  now["command"] = "resumed";
  now["evaluation_seconds"] = 5.0;
  Json expected = former;
  expected["complete"] = true;
  expected["evaluation_seconds"] = 5.0;
  CHECK(continued_metrics(now, former, false) == expected);
  // That of another iteration is not of these steps.
  CHECK(continued_metrics(now, metrics(10), false).at("loss") == 0.0);
}

TEST_CASE("what cannot be read of a run before counts as unknown") {
  const Json now = metrics(20);
  for (const Json& former : {Json(), Json::array({1}), Json("text")})
    CHECK(continued_metrics(now, former, true) == now);
  const Json odd = Json::parse(
      R"({"command":7,"iteration":"20","kernel_build_seconds":"x","peak_device_bytes":-5,
          "device":"a device","timed_steps":-1,"kernels":[1,{"name":2},{"name":"a","ms":"x"}],
          "photos":[{"name":3},"x",{"name":"p","psnr":20}]})");
  CHECK(continued_metrics(now, odd, true).at("kernels") == now.at("kernels"));
  CHECK(continued_metrics(now, odd, true).at("command") == "second");
  CHECK(continued_metrics(now, odd, false).at("timed_steps") == 4);
  const auto photos = former_photos(odd);
  REQUIRE(photos.size() == 1);
  CHECK(photos.at("p").at("psnr") == 20);
  CHECK(former_photos(Json()).empty());
  CHECK(former_number(Json(), "loss") == 0.0);
}

TEST_CASE("a run keeps all the commands that it went on by") {
  const Json first = metrics(10);
  CHECK_FALSE(first.contains("commands"));
  Json second = continued_metrics(metrics(20), first, true);
  CHECK(second.at("command") == "first");
  CHECK(second.at("commands") == Json::array({"first", "second"}));
  Json now = metrics(20);
  now["command"] = "third";
  now["iteration"] = 30;
  CHECK(continued_metrics(now, second, true).at("commands") ==
        Json::array({"first", "second", "third"}));
  // Without a step nothing is said anew, and what is no list of texts is none.
  CHECK(continued_metrics(second, second, false).at("commands").size() == 2);
  second["commands"] = 7;
  CHECK(continued_metrics(now, second, true).at("commands") == Json::array({"first", "third"}));
}
