// SPDX-License-Identifier: Apache-2.0
#include "io/photo/body_outline.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "raysplats/camera.hpp"

using namespace raysplats;
using raysplats::io::EdgePoint;
using raysplats::io::look_around;
using raysplats::io::outline_misfit;
using raysplats::io::RoundBody;

namespace {

constexpr int kWidth = 640, kHeight = 480;
constexpr double kFocal = 500;
constexpr double kDistance = 5, kRadius = 1;
const glm::dvec3 kBody(3, -2, 1);

// On a part of a circle around the body, in a plane with it.
std::vector<Camera> cameras_around(double angle) {
  std::vector<Camera> out;
  for (int i = 0; i < 9; ++i) {
    const double a = angle * i / 9;
    const glm::dvec3 eye = kBody + kDistance * glm::dvec3(std::cos(a), std::sin(a), 0);
    out.push_back(look_at(eye, kBody, {0, 0, 1}, kWidth, kHeight, kFocal));
  }
  return out;
}

// Distance of the outline from the middle of the picture.
double outline() { return kFocal * kRadius / std::sqrt(kDistance * kDistance - kRadius * kRadius); }

std::vector<EdgePoint> circle() {
  std::vector<EdgePoint> out;
  for (int i = 0; i < 12; ++i) {
    const glm::dvec2 outward(std::cos(0.5 * i), std::sin(0.5 * i));
    out.push_back({glm::dvec2(kWidth / 2, kHeight / 2) + outline() * outward, -outward});
  }
  return out;
}

std::vector<EdgePoint> sides() {
  std::vector<EdgePoint> out;
  for (const double y : {0.0, 200.0, 480.0}) {
    out.push_back({{kWidth / 2 - outline(), y}, {1, 0}});
    out.push_back({{kWidth / 2 + outline(), y}, {-1, 0}});
  }
  return out;
}

std::vector<EdgePoint> top() {
  return {{{100, 90}, {0, 1}}, {{320, 90}, {0, 1}}, {{500, 90}, {0, 1}}};
}

}  // namespace

TEST_CASE("balls and cylinders have the outlines that they have") {
  std::vector<Camera> cameras = cameras_around(6.28);
  CHECK(outline_misfit(cameras, circle(), RoundBody::kBall) < 1e-3);
  CHECK(outline_misfit(cameras, sides(), RoundBody::kCylinder) < 1e-9);
  CHECK(std::isinf(outline_misfit(cameras, top(), RoundBody::kCylinder)));
  CHECK(std::isinf(outline_misfit(cameras, {}, RoundBody::kBall)));
  CHECK(std::isinf(outline_misfit({}, sides(), RoundBody::kCylinder)));
  // One of nine stands off by half of the radius, and looks past the body.
  cameras[4] = moved(cameras[4], glm::dvec3(0), glm::dvec3(0, 0.5, 0));
  CHECK(outline_misfit(cameras, sides(), RoundBody::kCylinder) > 0.05);
}

TEST_CASE("cameras behind the body, or of one place, see no outline that tells") {
  std::vector<Camera> outward = cameras_around(6.28);
  for (Camera& camera : outward) {
    const glm::dvec3 eye = camera.center();
    camera = look_at(eye, 2.0 * eye - kBody, {0, 0, 1}, kWidth, kHeight, kFocal);
  }
  CHECK(std::isinf(outline_misfit(outward, sides(), RoundBody::kCylinder)));
  CHECK(look_around(outward));
  CHECK(look_around(cameras_around(1.57)));
  CHECK_FALSE(look_around(cameras_around(0.3)));
  const std::vector<Camera> one(8, cameras_around(1).front());
  CHECK_FALSE(look_around(one));
  CHECK(outline_misfit(one, sides(), RoundBody::kCylinder) >= 0);
}
