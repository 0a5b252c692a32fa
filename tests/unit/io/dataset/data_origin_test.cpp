// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/data_origin.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <span>
#include <vector>

#include "raysplats/io.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/log_capture.hpp"
#include "util/rng.hpp"

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

TEST_CASE("an origin that is no place near cameras is refused") {
  DatasetOptions options;
  for (const double odd : {std::nan(""), 1e300, -2e9}) {
    options.origin = {0, odd, 0};
    CHECK_THROWS_AS(load_dataset("nowhere", options), UsageError);
  }
}

TEST_CASE("cameras in one place without points count from 0 unless they are far away") {
  const glm::dvec3 place(3, -1, 2);
  std::vector<View> views(5);
  const auto stand = [&](const glm::dvec3& at) {
    for (std::size_t i = 0; i < views.size(); ++i) {
      const glm::dquat turn =
          glm::angleAxis(0.7 * static_cast<double>(i), glm::normalize(glm::dvec3(1, 2, 3)));
      Camera& camera = views[i].camera;
      camera.rotation = glm::mat3_cast(turn);
      // In one place but for rounding, to single precision as other programs do.
      for (int k = 0; k < 3; ++k)
        camera.translation[k] = static_cast<float>(-(camera.rotation * at)[k]);
    }
  };
  for (const double scale : {1.0, 100.0, 2000.0}) {
    CAPTURE(scale);
    stand(scale * place);
    CHECK(io::fitting_origin(views, {}) == glm::dvec3(0.0));
    CHECK(io::fitting_origin(std::span(views).first(1), {}) == glm::dvec3(0.0));
    // Points tell the size.
    std::vector<double> points;
    for (int i = 0; i < 30; ++i) points.push_back(scale * (place[i % 3] + 0.001 * (i % 7 - 3)));
    const glm::dvec3 origin = io::fitting_origin(views, points);
    CHECK(glm::distance(origin, scale * place) < 0.01 * scale);
  }
  stand(1e6 * place);
  CHECK(glm::distance(io::fitting_origin(views, {}), 1e6 * place) < 10.0);
}

TEST_CASE("the origin of a PLY is read back to the bit, and 0 is not written") {
  const Scratch scratch;
  Gaussians model;
  model.resize(1);
  const std::array<double, 3> origin{4.2e6 / 3.0, -1e-7, 123456.0};
  write_ply(scratch / "far.ply", model, TraceOptions{}, origin);
  CHECK(read_ply_origin(scratch / "far.ply") == origin);
  CHECK(read_ply_options(scratch / "far.ply").has_value());
  // Behind a byte order mark too.
  write_bytes(scratch / "marked.ply", "\xEF\xBB\xBF" + read_bytes(scratch / "far.ply"));
  CHECK(read_ply_origin(scratch / "marked.ply") == origin);
  CHECK(read_ply_options(scratch / "marked.ply").has_value());
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

TEST_CASE("positions in doubles that floats would blur count from an origin, which is told") {
  const Scratch scratch;
  constexpr std::size_t kCount = 40;
  const std::array<double, 3> place{448262.125, 5411932.0, 300.0};
  CounterRng rng(5, 5);
  std::vector<double> rest;
  for (std::size_t i = 0; i < 3 * kCount; ++i) rest.push_back(10.0 * rng.normal());
  // `log_size` of the Gaussians.
  const auto write = [&](double log_size, const std::string& comment) {
    std::string bytes =
        fmt::format("ply\nformat binary_little_endian 1.0\n{}element vertex {}\n", comment, kCount);
    for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                             "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
      bytes += fmt::format("property double {}\n", name);
    bytes += "end_header\n";
    for (std::size_t i = 0; i < kCount; ++i) {
      for (std::size_t k = 0; k < 3; ++k) put(bytes, place[k] + rest[3 * i + k]);
      for (const double value : {0.0, 0.0, 0.0, 0.0, log_size, log_size, -30.0, 1.0, 0.0, 0.0, 0.0})
        put(bytes, value);
    }
    // Far off and not finite, as they come.
    const double far = 1e12, nothing = std::nan("");
    std::memcpy(&bytes[bytes.size() - 28 * sizeof(double)], &far, sizeof(double));
    std::memcpy(&bytes[bytes.size() - 14 * sizeof(double)], &nothing, sizeof(double));
    write_bytes(scratch / "a.ply", bytes);
  };
  write(-4.0, "");
  {
    const LogCapture log;
    const Gaussians model = read_ply(scratch / "a.ply", true);
    const std::array<double, 3> origin = read_ply_origin(scratch / "a.ply");
    for (std::size_t k = 0; k < 3; ++k) {
      CHECK(std::fmod(origin[k], 10.0) == 0.0);
      CHECK(std::abs(origin[k] - place[k]) < 20.0);
    }
    CHECK(log.contains(fmt::format("count from {}, {}, {}", origin[0], origin[1], origin[2])));
    REQUIRE(model.size() == kCount - 1);
    double worst = 0;
    for (std::size_t i = 0; i < 3 * (kCount - 2); ++i) {
      const double expected = place[i % 3] + rest[i];
      worst = std::max(worst, std::abs(origin[i % 3] + model.means[i] - expected));
    }
    CHECK(worst < 1e-5);
    // As rounded numbers it would be a quarter.
    write_ply(scratch / "b.ply", model, std::nullopt, origin);
    CHECK(read_ply_origin(scratch / "b.ply") == origin);
    CHECK(read_ply(scratch / "b.ply").means == model.means);
  }
  const LogCapture log;
  // One that the header says has been taken off, and large Gaussians bear it.
  write(-4.0, "comment raysplats origin 1,2,3\n");
  CHECK(read_ply_origin(scratch / "a.ply") == std::array<double, 3>{1, 2, 3});
  CHECK(read_ply(scratch / "a.ply", true).means[0] == static_cast<float>(place[0] + rest[0]));
  write(5.0, "");
  CHECK(read_ply_origin(scratch / "a.ply") == std::array<double, 3>{});
  CHECK(read_ply(scratch / "a.ply", true).means[0] == static_cast<float>(place[0] + rest[0]));
  CHECK(!log.contains("count from"));
}
