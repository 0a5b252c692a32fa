// SPDX-License-Identifier: Apache-2.0
#include "view/mesh_uploads.hpp"

#include <doctest/doctest.h>

#include <chrono>
#include <cstddef>
#include <vector>

#include "raysplats/error.hpp"

using namespace raysplats;
using namespace raysplats::view;
using namespace std::chrono_literals;

TEST_CASE("meshes come in parts, one at a time, one a second, and never more than was offered") {
  MeshUploads uploads;
  MeshOffer offer;
  offer.bytes = 5;
  const std::vector<std::byte> part(3, std::byte{7});
  const MeshUploads::Clock::time_point start{};
  CHECK(!uploads.take(1, part, start));  // nobody has offered it
  uploads.begin(1, offer, start);
  CHECK(!uploads.take(1, part, start));
  CHECK(!uploads.take(2, part, start));  // another page's
  CHECK_THROWS_AS(uploads.begin(2, offer, start + 5s), UsageError);
  const auto whole = uploads.take(1, std::span(part).first(2), start);
  REQUIRE(whole);
  CHECK(whole->bytes == std::vector<std::byte>(5, std::byte{7}));
  CHECK_THROWS_AS(uploads.begin(2, offer, start + 500ms), UsageError);
  uploads.begin(2, offer, start + 1s);
  CHECK(!uploads.take(2, part, start + 1s));
  CHECK_THROWS_AS(uploads.take(2, part, start + 2s), UsageError);
  CHECK(!uploads.take(2, part, start + 2s));  // that mesh is over
  // Who falls silent gives way, as does who goes.
  uploads.begin(1, offer, start + 3s);
  uploads.begin(2, offer, start + 14s);
  uploads.forget(2);
  uploads.begin(1, offer, start + 16s);
}
