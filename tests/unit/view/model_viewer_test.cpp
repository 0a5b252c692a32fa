// SPDX-License-Identifier: Apache-2.0
#include "view/model_viewer.hpp"

#include <doctest/doctest.h>

#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "raysplats/error.hpp"
#include "skip_test.hpp"
#include "unit/fixture.hpp"
#include "unit/view/page_client.hpp"

using namespace raysplats;
using namespace raysplats::view;

TEST_CASE("the page of a model in memory has all that a model's file has") {
  Context context = make_test_context();
  Gaussians one;
  one.resize(1);
  const Model model(context, one);
  std::unique_ptr<ModelViewer> viewer;
  try {
    viewer = std::make_unique<ModelViewer>(context, model, TraceOptions{}, std::vector<Camera>{},
                                           "cloud", ViewerOptions{},
                                           std::array<double, 3>{4e6, 0.1, -2});
  } catch (const UsageError& error) {
    REQUIRE(std::string(error.what()).find("RAYSPLATS_VIEWER") != std::string::npos);
  }
  SKIP_TEST_UNLESS(viewer, "the viewer is not part of this build");
  const std::string answer = get(viewer->url(), "/api/state");
  const nlohmann::json state = nlohmann::json::parse(answer.substr(answer.find("\r\n\r\n")));
  for (const char* each : {"has_near", "has_depth", "has_order", "has_background"}) {
    CAPTURE(std::string(each));
    CHECK(state[each] == true);
  }
  CHECK(state["origin"] == nlohmann::json{4e6, 0.1, -2.0});
}
