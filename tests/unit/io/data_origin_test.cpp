// SPDX-License-Identifier: Apache-2.0
#include "io/data_origin.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "data_sets.hpp"
#include "raysplats/io.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

/// The same scene `by` further away in the coordinates of its files.
ColmapFixture moved(ColmapFixture fixture, const glm::dvec3& by) {
  for (ColmapFixture::ImageLine& image : fixture.images) {
    const auto& p = image.pose;
    const glm::dquat rotation = glm::normalize(glm::dquat(p[0], p[1], p[2], p[3]));
    const glm::dvec3 translation = glm::dvec3(p[4], p[5], p[6]) - rotation * by;
    for (std::size_t k = 0; k < 3; ++k) image.pose[4 + k] = translation[static_cast<int>(k)];
  }
  for (ColmapFixture::PointLine& point : fixture.points) {
    for (std::size_t k = 0; k < 3; ++k) point.position[k] += by[static_cast<int>(k)];
  }
  return fixture;
}

Dataset load(const Scratch& scratch, const ColmapFixture& fixture, const DatasetOptions& options) {
  fixture.write_binary(scratch / "data/sparse/0");
  write_photos(fixture, scratch / "data/images", 40, 30);
  return load_dataset(scratch / "data", options);
}

glm::dvec3 origin_of(const Dataset& dataset) {
  return {dataset.origin[0], dataset.origin[1], dataset.origin[2]};
}

}  // namespace

TEST_CASE("a scene far from the origin of its files is counted from where it is") {
  const ColmapFixture fixture = small_colmap();
  const Scratch scratch;
  const Dataset near = load(scratch, fixture, {});
  CHECK(origin_of(near) == glm::dvec3(0.0));
  for (const glm::dvec3& by : {glm::dvec3(4.2e6, -3.1e5, 4.8e6), glm::dvec3(0, 9000, 0)}) {
    const Scratch other;
    const Dataset far = load(other, moved(fixture, by), {});
    const glm::dvec3 origin = origin_of(far);
    CHECK(glm::length(origin - by) < 0.01 * glm::length(by));
    REQUIRE(far.views.size() == near.views.size());
    // The scene is what it was, but for a shift by a rest of its own size.
    const glm::dvec3 rest = by - origin;
    CHECK(glm::length(rest) < 100.0);
    for (std::size_t i = 0; i < near.views.size(); ++i) {
      CHECK(glm::distance(far.views[i].camera.center(), near.views[i].camera.center() + rest) <
            1e-6);
      CHECK(far.views[i].source_camera.center() == far.views[i].camera.center());
    }
    for (std::size_t i = 0; i < near.points.positions.size(); ++i) {
      const double expected = near.points.positions[i] + rest[static_cast<int>(i % 3)];
      CHECK(std::abs(far.points.positions[i] - expected) < 1e-5);
    }
    // A model that counts from elsewhere has its own say.
    DatasetOptions options;
    options.origin = {by.x, by.y, by.z};
    const Dataset told = load(other, moved(fixture, by), options);
    CHECK(origin_of(told) == by);
    CHECK(glm::distance(told.views[3].camera.center(), near.views[3].camera.center()) < 1e-6);
    options.origin.emplace();
    const Dataset as_it_is = load(other, moved(fixture, by), options);
    CHECK(origin_of(as_it_is) == glm::dvec3(0.0));
    CHECK(glm::distance(as_it_is.views[3].camera.center(), near.views[3].camera.center() + by) <
          1e-6);
  }
}

TEST_CASE("the origin of a PLY is read back to the bit, and 0 is not written") {
  const Scratch scratch;
  Gaussians model;
  model.resize(1);
  const std::array<double, 3> origin{4.2e6 / 3.0, -1e-7, 123456.0};
  write_ply(scratch / "far.ply", model, TraceOptions{}, origin);
  CHECK(read_ply_origin(scratch / "far.ply") == origin);
  CHECK(read_ply_options(scratch / "far.ply").has_value());
  write_ply(scratch / "alone.ply", model, std::nullopt, origin);
  CHECK(read_ply_origin(scratch / "alone.ply") == origin);
  CHECK_FALSE(read_ply_options(scratch / "alone.ply").has_value());
  write_ply(scratch / "near.ply", model, TraceOptions{});
  CHECK(read_ply_origin(scratch / "near.ply") == std::array<double, 3>{});
  CHECK_FALSE(contains(read_bytes(scratch / "near.ply"), "origin"));
  std::string bytes = read_bytes(scratch / "alone.ply");
  bytes.replace(bytes.find("origin 1"), 8, "origin x");
  write_bytes(scratch / "bad.ply", bytes);
  CHECK(contains(data_error([&] { read_ply_origin(scratch / "bad.ply"); }), "origin x"));
}
