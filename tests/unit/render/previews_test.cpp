// SPDX-License-Identifier: Apache-2.0
#include "render/previews.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <vector>

using namespace raysplats;

TEST_CASE("supersampling averages blocks") {
  Image image(4, 2, 2);
  for (std::size_t i = 0; i < image.data.size(); ++i) image.data[i] = static_cast<float>(i);
  const Image half = box_average(image, 2);
  CHECK(half.width == 2);
  CHECK(half.height == 1);
  CHECK(half.at(0, 0, 0) == (0 + 2 + 8 + 10) / 4.0f);
  CHECK(half.at(1, 0, 1) == (5 + 7 + 13 + 15) / 4.0f);
}

TEST_CASE("the depth preview is white near, black far and where nothing is") {
  Image depth(4, 1, 1);
  depth.data = {2.0f, 4.0f, 3.0f, 100.0f};
  Image rgba(4, 1, 4);
  for (std::size_t i = 0; i < 3; ++i) rgba.data[4 * i + 3] = 1.0f;
  CHECK(depth_preview(depth, rgba).data == std::vector<float>{1.0f, 0.0f, 0.5f, 0.0f});
  // What a wall that faces the camera has is flat but for rounding.
  Image wall(4, 1, 1, 3.0f);
  wall.data[1] = std::nextafter(3.0f, 4.0f);
  CHECK(depth_preview(wall, Image(4, 1, 1, 1.0f)).data == std::vector<float>(4, 1.0f));
}

TEST_CASE("normals and numbers of hits have colours of their own") {
  // Seen from the front, from above and from the right, by a camera that looks along z, y down.
  Image normals(4, 1, 3);
  normals.data = {0, 0, -1, 0, -1, 0, 1, 0, 0, 1, 0, 0};
  Image rgba(4, 1, 4, 1.0f);
  rgba.at(3, 0, 3) = 0.4f;
  const Image colors = normals_preview(normals, rgba, Camera{});
  CHECK(colors.data == std::vector<float>{0.5f, 0.5f, 1, 0.5f, 1, 0.5f, 1, 0.5f, 0.5f, 0, 0, 0});
  Image hits(3, 1, 1);
  hits.data = {0, 2, 8};
  CHECK(hits_preview(hits).data == std::vector<float>{0, 0.25f, 1});
  CHECK(hits_preview(Image(2, 1, 1)).data == std::vector<float>{0, 0});
  Image sums(2, 1, 3);
  sums.data = {0, 0.3f, 0.4f, 0, 0, 0};
  CHECK(unit_normals(sums).data == std::vector<float>{0, 0.6f, 0.8f, 0, 0, 0});
}
