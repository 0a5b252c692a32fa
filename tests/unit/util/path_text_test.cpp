// SPDX-License-Identifier: Apache-2.0
#include "util/path_text.hpp"

#include <doctest/doctest.h>

using namespace raysplats;

TEST_CASE("extensions are compared in small letters") {
  CHECK(lower_extension("a/Photo.JPeG") == ".jpeg");
  CHECK(lower_extension("a.b/photo") == "");
  CHECK(lower_extension("model.compressed.PLY") == ".ply");
  CHECK(lower_extension("photo.J\xc3\x84") == ".j\xc3\x84");
}

TEST_CASE("paths that were written on Windows have the separators of this system") {
  CHECK(portable_path("images\\left\\a.png") == std::filesystem::path("images/left/a.png"));
  CHECK(portable_path("./images/a.png") == std::filesystem::path("./images/a.png"));
  CHECK(portable_path("").empty());
}
