// SPDX-License-Identifier: Apache-2.0
#include "view/mesh_line.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <variant>
#include <vector>

#include "raysplats/error.hpp"

using namespace raysplats;
using namespace raysplats::view;

namespace {

PlaceMesh place(std::uint32_t mesh, double x, bool moving = false) {
  PlaceMesh out{mesh, {}, moving};
  out.placement.at.x = x;
  return out;
}

}  // namespace

TEST_CASE("a mesh that moves waits with its newest place, wherever in the line that is") {
  MeshLine line;
  line.put(1, place(7, 1, true));
  line.put(1, place(8, 2));
  line.put(1, MeshQuestion{});
  line.put(2, place(7, 3));
  line.put(1, RemoveMesh{7});
  line.put(1, place(7, 4));  // what is gone does not come back by it
  line.put(1, place(8, 5));
  const auto first = line.take();
  REQUIRE(first);
  CHECK(first->first == 2);
  CHECK(std::get<PlaceMesh>(first->second).placement.at.x == 3);
  CHECK_FALSE(std::get<PlaceMesh>(first->second).moving);
  CHECK(std::get<PlaceMesh>(line.take()->second).placement.at.x == 5);
  CHECK(std::holds_alternative<MeshQuestion>(line.take()->second));
  CHECK(std::get<RemoveMesh>(line.take()->second).mesh == 7);
  CHECK(std::get<PlaceMesh>(line.take()->second).placement.at.x == 4);
  CHECK(line.empty());
  CHECK_FALSE(line.take());
}

TEST_CASE("whoever says something about meshes to a full line is told so") {
  MeshLine line;
  for (std::size_t i = 0; i < MeshLine::kMost; ++i) {
    line.put(1, place(static_cast<std::uint32_t>(i), 0));
    line.put(1, place(0, static_cast<double>(i)));
  }
  CHECK_THROWS_AS(line.put(1, RemoveMesh{3}), UsageError);
  CHECK_THROWS_AS(line.put(1, place(99, 0)), UsageError);
  line.put(1, place(3, 1));
  // Files have a limit of their own.
  line.put(1, SentMesh{});
  CHECK_THROWS_AS(line.put(2, SentMesh{}), UsageError);
  std::size_t count = 0;
  while (line.take()) ++count;
  CHECK(count == MeshLine::kMost + 1);
}
