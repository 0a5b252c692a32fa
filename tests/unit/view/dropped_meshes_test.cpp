// SPDX-License-Identifier: Apache-2.0
#include "view/dropped_meshes.hpp"

#include <doctest/doctest.h>

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>

#include "raysplats/error.hpp"

using namespace raysplats;
using namespace raysplats::view;

namespace {

SentMesh triangle(const std::string& name) {
  constexpr std::string_view kText = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  SentMesh sent;
  sent.offer.name = name;
  for (const char c : kText) sent.bytes.push_back(static_cast<std::byte>(c));
  return sent;
}

}  // namespace

TEST_CASE("what cannot be shown changes no list of dropped meshes") {
  bool fails = false;
  std::size_t shown = 0;
  DroppedMeshes meshes(
      [&](const std::vector<Mesh>& all) {
        if (fails) throw std::runtime_error("no device");
        shown = all.size();
      },
      "", "");
  for (const char* name : {"a.obj", "b.obj", "c.obj"}) meshes.add(triangle(name));
  const std::string before = meshes.json();
  CHECK(nlohmann::json::parse(before)["meshes"].size() == 3);
  fails = true;
  for (const std::uint32_t mesh : {1u, 2u, 3u}) {
    CAPTURE(mesh);
    CHECK_THROWS_WITH(meshes.remove(mesh), "no device");
    CHECK(meshes.json() == before);
    Placement far;
    far.size = 7;
    CHECK_THROWS_WITH(meshes.place(mesh, far), "no device");
    CHECK(meshes.json() == before);
  }
  CHECK_THROWS_WITH(meshes.add(triangle("d.obj")), "no device");
  CHECK(meshes.json() == before);
  fails = false;
  meshes.remove(2);
  CHECK(shown == 2);
  CHECK_THROWS_AS(meshes.remove(2), UsageError);
}
