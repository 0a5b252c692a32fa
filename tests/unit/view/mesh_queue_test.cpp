// SPDX-License-Identifier: Apache-2.0
#include "view/mesh_queue.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <variant>

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

TEST_CASE("a mesh that moves waits with its newest place, wherever in the queue that is") {
  MeshQueue queue;
  queue.put(1, place(7, 1, true));
  queue.put(1, place(8, 2));
  queue.put(1, MeshQuestion{});
  queue.put(2, place(7, 3));
  queue.put(1, RemoveMesh{7});
  queue.put(1, place(7, 4));  // what is gone does not come back by it
  queue.put(1, place(8, 5));
  const auto first = queue.take();
  REQUIRE(first);
  CHECK(first->first == 2);
  CHECK(std::get<PlaceMesh>(first->second).placement.at.x == 3);
  CHECK_FALSE(std::get<PlaceMesh>(first->second).moving);
  CHECK(std::get<PlaceMesh>(queue.take()->second).placement.at.x == 5);
  CHECK(std::holds_alternative<MeshQuestion>(queue.take()->second));
  CHECK(std::get<RemoveMesh>(queue.take()->second).mesh == 7);
  CHECK(std::get<PlaceMesh>(queue.take()->second).placement.at.x == 4);
  CHECK(queue.empty());
  CHECK_FALSE(queue.take());
}

TEST_CASE("whoever says something about meshes to a full queue is told so") {
  MeshQueue queue;
  for (std::size_t i = 0; i < MeshQueue::kMost; ++i) {
    queue.put(1, place(static_cast<std::uint32_t>(i), 0));
    queue.put(1, place(0, static_cast<double>(i)));
  }
  CHECK_THROWS_AS(queue.put(1, RemoveMesh{3}), UsageError);
  CHECK_THROWS_AS(queue.put(1, place(99, 0)), UsageError);
  queue.put(1, place(3, 1));
  // Files have a limit of their own.
  queue.put(1, SentMesh{});
  CHECK_THROWS_AS(queue.put(2, SentMesh{}), UsageError);
  std::size_t count = 0;
  while (queue.take()) ++count;
  CHECK(count == MeshQueue::kMost + 1);
}
