// SPDX-License-Identifier: Apache-2.0
// Depth maps in the forms that programs write them.
#include "io/photo/depth_map.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "unit/io/scratch.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

template <class T>
std::string npy(const std::string& type,
                const std::string& shape,
                const std::vector<T>& numbers,
                bool fortran = false) {
  const std::string header = fmt::format("{{'descr': '{}', 'fortran_order': {}, 'shape': {}, }}\n",
                                         type, fortran ? "True" : "False", shape);
  std::string bytes("\x93NUMPY\x01\x00", 8);
  put(bytes, static_cast<std::uint16_t>(header.size()));
  bytes += header;
  for (const T number : numbers) put(bytes, number);
  return bytes;
}

}  // namespace

TEST_CASE("arrays of depths may have a channel, first or last, and any type and order") {
  const Scratch scratch;
  const auto check = [&](const std::string& bytes) {
    write_bytes(scratch / "a.npy", bytes);
    const io::DepthMap map = io::read_depth_map(scratch / "a.npy", 0.5);
    CHECK(map.width == 3);
    CHECK(map.height == 2);
    CHECK(map.values == std::vector<float>{0.5f, 1, 1.5f, 2, 2.5f, 3});
  };
  const std::vector<float> six{1, 2, 3, 4, 5, 6};
  check(npy("<f4", "(2, 3)", six));
  check(npy("<f4", "(2, 3, 1)", six));
  check(npy("<f4", "(1, 2, 3)", six));
  check(npy("<u2", "(2, 3)", std::vector<std::uint16_t>{1, 2, 3, 4, 5, 6}));
  check(npy(">u2", "(2, 3, 1)", std::vector<std::uint16_t>{256, 512, 768, 1024, 1280, 1536}));
  check(npy("<f8", "(2, 3)", std::vector<double>{1, 4, 2, 5, 3, 6}, true));
  // Halves of 1 to 6.
  check(npy("<f2", "(1, 2, 3)",
            std::vector<std::uint16_t>{0x3c00, 0x4000, 0x4200, 0x4400, 0x4500, 0x4600}));
  for (const char* shape : {"(6,)", "(3, 2, 1, 1)", "(1, 1, 2, 3)", "()"}) {
    write_bytes(scratch / "a.npy",
                npy("<f4", shape, std::string(shape) == "()" ? std::vector<float>{1} : six));
    CHECK(
        contains(data_error([&] { io::read_depth_map(scratch / "a.npy", 1); }), "height x width"));
  }
}

TEST_CASE("depths that are not finite or not above 0 are unknown, and the first are told") {
  const Scratch scratch;
  const float infinity = std::numeric_limits<float>::infinity();
  write_bytes(scratch / "a.npy", npy("<f4", "(2, 3)",
                                     std::vector<float>{std::numeric_limits<float>::quiet_NaN(),
                                                        infinity, -infinity, 0.0f, -2.0f, 3.0f}));
  const LogCapture log;
  CHECK(io::read_depth_map(scratch / "a.npy", 2).values == std::vector<float>{0, 0, 0, 0, 0, 6});
  CHECK(log.contains("3 of 6 numbers"));
  CHECK(log.lines() == 1);
  CHECK(io::read_depth_map(scratch / "a.npy", 2, true).values ==
        std::vector<float>{0, 0, 0, 0, 0, 6});
  CHECK(log.lines() == 1);
  // A sensor may have measured nothing.
  write_bytes(scratch / "a.npy", npy("<i2", "(1, 2)", std::vector<std::int16_t>{0, -5}));
  CHECK(io::read_depth_map(scratch / "a.npy", 1).values == std::vector<float>{0, 0});
}

TEST_CASE("a map is checked for what its view would find wrong, and for whether it knows any") {
  const Scratch scratch;
  View view;
  view.camera.width = view.source_camera.width = 400;
  view.camera.height = view.source_camera.height = 200;
  view.depth_path = scratch / "a.npy";
  const auto has_depths = [&](const char* shape, const std::vector<float>& numbers) {
    write_bytes(view.depth_path, npy("<f4", shape, numbers));
    return io::check_depth_map(view, 1);
  };
  CHECK(has_depths("(2, 4)", {0, 0, 0, 0, 0, 0, 0, 3}));
  CHECK_FALSE(has_depths("(2, 4)", {0, 0, 0, 0, 0, -1, 0, 0}));
  const std::vector<float> tall(32, 1.0f);
  CHECK(contains(data_error([&] { has_depths("(8, 4)", tall); }), "which is another shape"));
  CHECK(contains(data_error([&] {
                   has_depths("(8,)", {1, 1, 1, 1, 1, 1, 1, 1});
                 }),
                 "height x width"));
}
