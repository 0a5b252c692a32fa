// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "device/kernel.hpp"
#include "shared/ray_layout.h"
#include "unit/fixture.hpp"

using namespace raysplats;

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kLargest = std::numeric_limits<float>::max();

/// An RsRay.
using RayNumbers = std::array<float, 8>;

/// Which children of a node each ray meets: child 0 is the cube [-1, 1], the others are missing.
std::vector<std::uint32_t> meet_node(Context& context,
                                     const std::vector<RsRay>& rays,
                                     std::size_t lanes,
                                     bool exact) {
  std::vector<float> node(6 * lanes, kLargest);
  for (std::size_t k = 0; k < 6; ++k) {
    for (std::size_t lane = 0; lane < lanes; ++lane)
      node[k * lanes + lane] = k < 3 ? kLargest : -kLargest;
    node[k * lanes] = k < 3 ? -1.0f : 1.0f;
  }
  BuildOptions build;
  build.define("LANES", lanes);
  if (exact) build.define("RS_EXACT_SLABS", 1);
  Buffer<RsRay> device_rays(context, rays.size(), "rays");
  device_rays.upload(rays);
  Buffer<float> device_node(context, node.size(), "node");
  device_node.upload(node);
  Buffer<std::uint32_t> met(context, rays.size(), "met");
  context.kernel("bvh/node_probe.cl", "meet_node", build)
      .launch(Range::linear(rays.size(), 1), static_cast<std::uint32_t>(rays.size()), device_rays,
              device_node, met);
  return met.download();
}

}  // namespace

TEST_CASE("a missing child is met by no ray, whatever its numbers") {
  Context context(test_device());
  const RayNumbers sound{0.1f, 0.2f, -4.0f, 0.0f, 0.0f, 0.0f, 1.0f, kInfinity};
  std::vector<RsRay> rays{std::bit_cast<RsRay>(sound)};
  for (const float value : {std::numeric_limits<float>::quiet_NaN(), kInfinity, -kInfinity,
                            kLargest, -1e38f, 1e20f, -1e16f, 1e-38f, 0.0f}) {
    for (std::size_t k = 0; k < 8; ++k) {
      RayNumbers numbers = sound;
      numbers[k] = value;
      rays.push_back(std::bit_cast<RsRay>(numbers));
    }
    rays.push_back({{value, value, value}, 0.0f, {value, value, value}, kInfinity});
  }
  for (const std::size_t lanes : {4, 8, 16}) {
    for (const bool exact : {false, true}) {
      CAPTURE(lanes);
      CAPTURE(exact);
      const std::vector<std::uint32_t> met = meet_node(context, rays, lanes, exact);
      CHECK(met[0] == 1);
      for (std::size_t i = 0; i < met.size(); ++i) {
        CAPTURE(i);
        CHECK((met[i] & ~1u) == 0);
      }
    }
  }
}
