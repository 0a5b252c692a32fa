// SPDX-License-Identifier: Apache-2.0
#include "eval/photo_agreement.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/vec3.hpp>
#include <numbers>
#include <numeric>
#include <set>
#include <vector>

using namespace raysplats;

namespace {

using Positions = std::vector<std::size_t>;

/// A photo on a walk around the origin, towards which it looks.
PlacedPhoto seen_from(double angle, double height, double psnr) {
  const glm::dvec3 place(std::cos(angle), std::sin(angle), height);
  return {psnr, place, glm::dvec3(-std::cos(angle), -std::sin(angle), 0)};
}

/// Two walks of so many photos, which differ by 3 dB at most.
std::vector<PlacedPhoto> walks(std::size_t each) {
  std::vector<PlacedPhoto> out;
  for (std::size_t i = 0; i < 2 * each; ++i) {
    const double angle =
        2 * std::numbers::pi * static_cast<double>(i % each) / static_cast<double>(each);
    out.push_back(seen_from(angle, i < each ? 0.0 : 0.5, 30.0 + static_cast<double>(i % 4)));
  }
  return out;
}

}  // namespace

TEST_CASE("photos beside one are the nearest that look the same way") {
  const std::vector<PlacedPhoto> photos = walks(30);
  const auto beside = [](const std::vector<PlacedPhoto>& all, double degrees, std::size_t count,
                         double farthest) {
    const Positions found = photos_beside(all, 10, degrees, count, farthest);
    return std::set<std::size_t>(found.begin(), found.end());
  };
  CHECK(beside(photos, 30, 5, 10) == std::set<std::size_t>{8, 9, 11, 12, 40});
  CHECK(photos_beside(photos, 10, 30, 5, 10).back() == 40);
  CHECK(beside(photos, 20, 5, 10) == std::set<std::size_t>{9, 11, 39, 40, 41});
  CHECK(beside(photos, 30, 5, 0.3) == std::set<std::size_t>{9, 11});
  std::vector<PlacedPhoto> panoramas = photos;
  for (PlacedPhoto& photo : panoramas) photo.direction.reset();
  CHECK(beside(panoramas, 1, 4, 10) == std::set<std::size_t>{8, 9, 11, 12});
  CHECK(photos_beside(std::vector<PlacedPhoto>(1), 0, 30, 5, 10).empty());
}

TEST_CASE("sound photos are all kept, those at the border of a capture too") {
  std::vector<PlacedPhoto> photos = walks(30);
  CHECK(photos_to_leave_out(photos).empty());
  CHECK(contradicted_photos(photos).empty());
  // What a part of the walk shows is hard to learn.
  for (std::size_t i = 0; i < 10; ++i) photos[i].psnr = photos[30 + i].psnr = 20;
  CHECK(photos_to_leave_out(photos).empty());
  // One looks where no other does.
  photos[15].psnr = 10;
  photos[15].direction = glm::dvec3(0, 0, 1);
  CHECK(photos_to_leave_out(photos).empty());
}

TEST_CASE("photos that stand out from those beside them are left out") {
  std::vector<PlacedPhoto> photos = walks(30);
  photos[4].psnr = photos[20].psnr = photos[21].psnr = photos[50].psnr = 20;
  photos[12].psnr = 26;  // not far enough
  CHECK(photos_to_leave_out(photos) == Positions{4, 20, 21, 50});
  CHECK(contradicted_photos(photos).empty());  // a few are no part of a capture
  // Of fewer photos each shows what no other does.
  std::vector<PlacedPhoto> few(photos.begin(), photos.begin() + 11);
  CHECK(photos_to_leave_out(few).empty());
}

TEST_CASE("of a folded capture one side is left out as a whole") {
  std::vector<PlacedPhoto> photos = walks(30);
  // The walk above saw something else from here on, little of which fits; at its ends more does.
  for (std::size_t i = 35; i < 50; ++i) photos[i].psnr = 18;
  photos[34].psnr = photos[50].psnr = 23;
  const Positions some = contradicted_photos(photos);
  CHECK(some.size() > 6);
  Positions side(17);
  std::iota(side.begin(), side.end(), std::size_t{34});
  CHECK(photos_to_leave_out(photos) == side);
  // Where most of them would go nobody knows which are wrong.
  for (std::size_t i = 0; i < 60; ++i)
    if (i % 10 >= 3) photos[i].psnr = 18;
  CHECK(photos_to_leave_out(photos).empty());
}

TEST_CASE(
    "dark photos beside bright ones contradict nothing, though they are nearer to the model") {
  std::vector<PlacedPhoto> photos = walks(30);
  for (std::size_t i = 0; i < photos.size(); ++i) {
    photos[i].contrast = i % 2 == 0 ? -12 : -21;
    if (i % 2 != 0) photos[i].psnr += 9;
  }
  CHECK(photos_to_leave_out(photos).empty());
  photos[10].psnr = 15;
  CHECK(photos_to_leave_out(photos) == Positions{10});
}

TEST_CASE("many photos that stand alone are no fold: what they spoil beside them is kept") {
  std::vector<PlacedPhoto> photos = walks(30);
  Positions wrong;
  for (std::size_t i = 2; i < photos.size(); i += 7) {
    photos[i].psnr = 14;
    wrong.push_back(i);
  }
  photos[17].psnr = 24.5;
  Positions some = wrong;
  some.push_back(17);
  std::sort(some.begin(), some.end());
  CHECK(contradicted_photos(photos) == some);
  CHECK(photos_to_leave_out(photos) == wrong);
}
