// SPDX-License-Identifier: Apache-2.0
#include "io/photo/view_loader.hpp"

#include <doctest/doctest.h>

#include <string>
#include <thread>
#include <vector>

#include "raysplats/io.hpp"
#include "unit/io/scratch.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

constexpr int kSide = 16;
constexpr std::size_t kBytes = kSide * kSide * 4;

/// Views of photos whose red value is their index.
std::vector<View> make_views(const Scratch& scratch, std::size_t count) {
  std::vector<View> views(count);
  for (std::size_t i = 0; i < count; ++i) {
    Image image(kSide, kSide, 3);
    for (std::size_t p = 0; p < image.pixels(); ++p)
      image.data[3 * p] = static_cast<float>(i) / 255.0f;
    views[i].image_path = scratch / (std::to_string(i) + ".png");
    write_image(views[i].image_path, image);
    views[i].camera.width = views[i].source_camera.width = kSide;
    views[i].camera.height = views[i].source_camera.height = kSide;
  }
  return views;
}

}  // namespace

TEST_CASE("views come back right in any order, prefetched or not, within the budget") {
  const Scratch scratch;
  const auto views = make_views(scratch, 12);
  for (const unsigned threads : {1u, 4u}) {
    io::ViewLoader loader(views, 5 * kBytes + 10, threads);
    CHECK(loader.size() == 12);
    CounterRng rng(1, threads);
    for (int step = 0; step < 200; ++step) {
      std::vector<std::size_t> order;
      for (int i = 0; i < 7; ++i) order.push_back(rng.below(13));  // one index too many is ignored
      if (step % 3 != 0) loader.prefetch(order);
      const std::size_t index = order[rng.below(3)] % 12;
      const auto image = loader.get(index);
      CHECK(image->words.size() == kSide * kSide);
      CHECK(image->words[7] == (0xff000000u | static_cast<std::uint32_t>(index)));
      CHECK(loader.cached_bytes() <= 5 * kBytes + 10);
    }
  }
}

TEST_CASE("a loaded picture says how sharp it is, also once it is forgotten") {
  const Scratch scratch;
  const auto views = make_views(scratch, 3);
  Image dot(kSide, kSide, 3);
  for (int c = 0; c < 3; ++c) dot.at(5, 6, c) = 1.0f;
  write_image(views[1].image_path, dot);
  io::ViewLoader loader(views, 3 * kBytes);
  for (std::size_t i = 0; i < 4; ++i) CHECK(!loader.sharpness_of(i));
  for (std::size_t i = 0; i < 2; ++i) {
    loader.get(i);
    loader.forget(i);
  }
  CHECK(loader.sharpness_of(0)->fine == 0.0);
  CHECK(loader.sharpness_of(1)->fine == doctest::Approx((16.0 + 4.0) / (kSide * kSide)));
  CHECK(!loader.sharpness_of(2));
}

TEST_CASE("what was used last stays: deleted files show what is kept") {
  const Scratch scratch;
  const auto views = make_views(scratch, 4);
  io::ViewLoader loader(views, 2 * kBytes, 1);
  for (const std::size_t index : {0u, 1u, 0u, 2u}) loader.get(index);
  for (const View& view : views) fs::remove(view.image_path);
  CHECK(loader.get(0)->words[0] == 0xff000000u);
  CHECK(loader.get(2)->words[0] == 0xff000002u);
  CHECK(contains(data_error([&] { loader.get(1); }), "1.png"));
}

TEST_CASE("a picture above the budget is returned and not kept, and outlives its eviction") {
  const Scratch scratch;
  const auto views = make_views(scratch, 2);
  io::ViewLoader loader(views, 10, 2);
  const auto first = loader.get(0);
  const auto second = loader.get(1);
  CHECK(first->words[0] == 0xff000000u);
  CHECK(second->words[0] == 0xff000001u);
  CHECK(loader.cached_bytes() == 0);
}

TEST_CASE("a wait ends when the picture is there, has failed, or the time is over") {
  const Scratch scratch;
  auto views = make_views(scratch, 2);
  views[1].image_path = scratch / "none.png";
  io::ViewLoader loader(views, 5 * kBytes);
  CHECK(!loader.wait(0, 0.01));  // nobody has asked for it
  loader.prefetch(std::vector<std::size_t>{0, 1});
  CHECK(loader.wait(0, 600));
  CHECK(loader.wait(1, 600));
  CHECK(loader.get(0)->words.size() == kSide * kSide);
  CHECK_THROWS_AS(loader.get(1), DataError);
  CHECK(loader.wait(2, 600));
  CHECK_THROWS_AS(loader.get(2), UsageError);
}

TEST_CASE("what is forgotten is read again") {
  const Scratch scratch;
  const auto views = make_views(scratch, 2);
  io::ViewLoader loader(views, 10 * kBytes, 1);
  const auto first = loader.get(0);
  loader.forget(1);  // never read
  loader.forget(7);  // none
  CHECK(loader.cached_bytes() == kBytes);
  loader.forget(0);
  CHECK(loader.cached_bytes() == 0);
  CHECK(first->words[0] == 0xff000000u);
  CHECK(loader.get(0)->words == first->words);
  fs::remove(views[0].image_path);
  loader.forget(0);
  CHECK(contains(data_error([&] { loader.get(0); }), "0.png"));
}

TEST_CASE("errors of the workers surface in get, and a repaired file is read again") {
  const Scratch scratch;
  const auto views = make_views(scratch, 3);
  const std::string whole = read_bytes(views[1].image_path);
  write_bytes(views[1].image_path, "");
  io::ViewLoader loader(views, 100 * kBytes);
  loader.prefetch(std::vector<std::size_t>{0, 1, 2});
  CHECK(loader.get(2)->words[0] == 0xff000002u);
  CHECK(contains(data_error([&] { loader.get(1); }), "empty"));
  CHECK(contains(data_error([&] { loader.get(1); }), "empty"));
  write_bytes(views[1].image_path, whole);
  CHECK(loader.get(1)->words[0] == 0xff000001u);
  CHECK_THROWS_AS(loader.get(3), UsageError);
}

TEST_CASE("several callers may ask at once, and a loader with queued work can be destroyed") {
  const Scratch scratch;
  const auto views = make_views(scratch, 8);
  for (int round = 0; round < 10; ++round) {
    io::ViewLoader loader(views, 2 * kBytes, 3);
    std::vector<int> wrong(4, 0);
    {
      std::vector<std::jthread> callers;
      for (std::size_t t = 0; t < 4; ++t) {
        callers.emplace_back([&, t] {
          CounterRng rng(t, static_cast<std::uint64_t>(round));
          for (int i = 0; i < 50; ++i) {
            const std::size_t index = rng.below(8);
            if (i % 10 == 0) loader.prefetch(std::vector<std::size_t>{index, (index + 1) % 8});
            if (loader.get(index)->words[3] != (0xff000000u | static_cast<std::uint32_t>(index)))
              ++wrong[t];
          }
        });
      }
    }
    CHECK(wrong == std::vector<int>{0, 0, 0, 0});
    CHECK(loader.cached_bytes() <= 2 * kBytes);
    loader.prefetch(std::vector<std::size_t>{0, 1, 2, 3, 4, 5, 6, 7});
  }
  io::ViewLoader empty({}, 100);
  empty.prefetch(std::vector<std::size_t>{0});
  CHECK_THROWS_AS(empty.get(0), UsageError);
}
