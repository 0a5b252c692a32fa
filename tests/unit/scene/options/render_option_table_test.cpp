// SPDX-License-Identifier: Apache-2.0
#include "scene/options/render_option_table.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <string>

#include "raysplats/error.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using test::contains;

namespace {

std::string refusal(void (*change)(RenderSettings&)) {
  RenderSettings settings;
  change(settings);
  return test::message_of<UsageError>([&] { check_render_settings(settings); });
}

}  // namespace

TEST_CASE("settings of paths that programs make have the ranges of scene files") {
  CHECK(refusal([](RenderSettings&) {}).empty());
  CHECK(refusal([](RenderSettings& s) {
          s.seed = std::numeric_limits<std::uint64_t>::max();
        }).empty());
  CHECK(refusal([](RenderSettings& s) { s.samples = 65537; }) ==
        "The option 'samples' needs a whole number from 1 to 65536, not '65537'");
  CHECK(contains(refusal([](RenderSettings& s) { s.max_bounces = 1001; }), "'max-bounces'"));
  CHECK(contains(refusal([](RenderSettings& s) { s.min_throughput = 1.5f; }), "'min-throughput'"));
  CHECK(contains(refusal([](RenderSettings& s) { s.ambient[1] = -1; }), "'ambient'"));
  CHECK(contains(refusal([](RenderSettings& s) { s.light_samples = 1025; }), "'light-samples'"));
  CHECK(contains(
      refusal([](RenderSettings& s) { s.aperture = std::numeric_limits<float>::quiet_NaN(); }),
      "'aperture'"));
  CHECK(contains(refusal([](RenderSettings& s) { s.focus_distance = 0; }), "'focus-distance'"));
  CHECK(contains(refusal([](RenderSettings& s) { s.bias = -1; }), "'bias'"));
  CHECK(contains(refusal([](RenderSettings& s) { s.shadows.strength = 2; }), "'strength'"));
}

TEST_CASE("settings that were given go over those of a scene") {
  RenderSettings scene;
  scene.samples = 7;
  scene.max_bounces = 3;
  GivenRenderSettings given;
  given.set("samples", {"2"});
  given.set("ambient", {"1000"});
  CHECK(given.over(scene).samples == 2);
  CHECK(given.over(scene).max_bounces == 3);
  CHECK(given.over(scene).ambient == Rgb{1000, 1000, 1000});
}
