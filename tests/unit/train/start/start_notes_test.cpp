// SPDX-License-Identifier: Apache-2.0
// What a run says at its start of the photos and options that it was given.
#include <doctest/doctest.h>

#include <cstddef>
#include <string>
#include <vector>

#include "raysplats/trainer.hpp"
#include "unit/log_capture.hpp"
#include "unit/train/photographed.hpp"
#include "unit/train/short_training.hpp"
#include "unit/train/test_photos.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

// Photos of which counting holds out every n-th, unless n is 0.
struct Capture : Photographed {
  explicit Capture(const std::vector<Camera>& cameras)
      : Photographed(coloured_cloud(60, 0.6, 31), cameras) {}

  void hold_out(int every) {
    dataset.test_every = every;
    for (std::size_t i = 0; i < dataset.views.size(); ++i)
      dataset.views[i].test = every > 0 && i % static_cast<std::size_t>(every) == 0;
  }

  // Whether the start of a run says so.
  bool says(const std::string& part, TrainOptions options) {
    options.init = "random";
    options.init_count = 100;
    options.max_gaussians = 100;
    const LogCapture log;
    Trainer trainer(context, dataset, options, folder / ("run" + std::to_string(runs++)));
    trainer.step();
    return log.contains(part);
  }

  int runs = 0;
};

}  // namespace

TEST_CASE("a run is warned of held-out photos that are all of one lens of a rig") {
  const std::string warning = "look where no training photo does", advice = "--test-every 9 holds";
  const TrainOptions options = short_training(40);
  Capture rig(rig_of_eight(4));
  rig.hold_out(8);
  CHECK(rig.says("most of the 4 held-out photos " + warning, options));
  CHECK(rig.says(advice, options));
  // Where the files of a data set name its test views, another number changes nothing.
  rig.dataset.test_every = 0;
  CHECK_FALSE(rig.says(warning, options));
  rig.hold_out(9);
  CHECK_FALSE(rig.says(warning, options));
  rig.hold_out(2);
  CHECK(rig.says("--test-every 3 holds", options));

  Capture orbit(ring(32, 3.0, {0, 0, 0}));
  orbit.hold_out(8);
  CHECK_FALSE(orbit.says(warning, options));
}

TEST_CASE("a run that ends within its first pass says how many photos it never looks at") {
  Capture capture(ring(8, 3.0, {0, 0, 0}));
  capture.hold_out(0);
  TrainOptions options = short_training(5);
  CHECK(capture.says("within 5 iterations the run never looks at 3 of the 8 training photos",
                     options));
  options.iterations = 8;
  CHECK_FALSE(capture.says("never looks at", options));
  options.views_per_step = 2;
  options.iterations = 3;
  CHECK(capture.says("within 3 iterations the run never looks at 2 of the 8", options));
  options.iterations = 4;
  CHECK_FALSE(capture.says("never looks at", options));
}

TEST_CASE("a run says which of its options change nothing, and that it never grows") {
  Capture capture(ring(8, 3.0, {0, 0, 0}));
  TrainOptions options = short_training(8);
  CHECK_FALSE(capture.says("change nothing", options));
  CHECK_FALSE(capture.says("never grows", options));
  options.split_factor = 2;
  CHECK(capture.says("change nothing of this run: split-factor (for strategy = adc)", options));
  options.densify_from = 0.9;
  CHECK(capture.says("densify-from = 0.9 is later than densify-until = 0.65", options));
  options.densify_until = 0;  // none is wanted
  CHECK_FALSE(capture.says("never grows", options));
}

TEST_CASE("a run is warned of photos without colour among coloured ones, and names some") {
  Capture capture(ring(8, 3.0, {0, 0, 0}));
  capture.hold_out(0);
  const std::string warning = "have no colour where others show some, view_2.png, view_5.png among";
  const TrainOptions options = short_training(8);
  CHECK_FALSE(capture.says("no colour", options));
  for (const std::size_t i : {2, 5}) {
    const std::filesystem::path& path = capture.dataset.views[i].image_path;
    Image photo = read_image(path);
    for (std::size_t p = 0; p < photo.pixels(); ++p) {
      float* pixel = photo.data.data() + 3 * p;
      pixel[0] = pixel[1] = pixel[2] = (pixel[0] + pixel[1] + pixel[2]) / 3;
    }
    write_image(path, photo);
  }
  CHECK(capture.says("2 of 8 training photos " + warning, options));
}

TEST_CASE("a run is warned of masks that keep what they should leave out, and names one") {
  Capture capture(ring(8, 3.0, {0, 0, 0}));
  capture.hold_out(0);
  const TrainOptions options = short_training(8);
  for (const bool inverted : {false, true}) {
    for (std::size_t i = 0; i < 8; ++i) {
      // Somebody who stands elsewhere in each photo.
      Image mask(100, 80, 1, inverted ? 0.0f : 1.0f);
      for (int y = 20; y < 60; ++y) {
        for (int x = 0; x < 12; ++x)
          mask.at(x + 12 * static_cast<int>((3 * i) % 7), y, 0) = inverted ? 1.0f : 0.0f;
      }
      View& view = capture.dataset.views[i];
      view.mask_path = capture.folder / ("mask_" + std::to_string(i) + ".png");
      write_image(view.mask_path, mask);
    }
    CHECK(capture.says("mask_0.png among them, seem to be inverted", options) == inverted);
  }
}

TEST_CASE("a run is warned of a ground that does not turn with a turntable, but not beside masks") {
  Capture capture(ring(16, 3.0, {0, 0, 0}));
  capture.hold_out(0);
  const TrainOptions options = short_training(16);
  CHECK_FALSE(capture.says("turntable", options));
  const auto is_body = [](int x, int y) { return x > 30 && x < 50 && y > 20; };
  for (std::size_t i = 0; i < capture.dataset.views.size(); ++i) {
    View& view = capture.dataset.views[i];
    Image photo = read_image(view.image_path);
    for (int y = 0; y < photo.height; ++y) {
      for (int x = 0; x < photo.width; ++x) {
        for (int c = 0; c < 3 && !is_body(x, y); ++c)
          photo.at(x, y, c) = (x / 4 + y / 5) % 2 == 0 ? 0.8f : 0.2f;
      }
    }
    write_image(view.image_path, photo);
  }
  CHECK(capture.says("at the same pixels of 16 of 16 of them", options));
  CHECK(capture.says("leave it out by masks", options));
  for (std::size_t i = 0; i < capture.dataset.views.size(); ++i) {
    View& view = capture.dataset.views[i];
    const Image photo = read_image(view.image_path);
    Image mask(photo.width, photo.height, 1, 0.0f);
    for (int y = 0; y < photo.height; ++y) {
      for (int x = 0; x < photo.width; ++x) mask.at(x, y, 0) = is_body(x, y) ? 1.0f : 0.0f;
    }
    view.mask_path = capture.folder / ("body_" + std::to_string(i) + ".png");
    write_image(view.mask_path, mask);
  }
  CHECK_FALSE(capture.says("does not turn", options));
}

TEST_CASE("a run is warned of what stands at the same pixels of all photos, and says where") {
  Capture capture(ring(16, 3.0, {0, 0, 0}));
  capture.hold_out(0);
  const TrainOptions options = short_training(16);
  CHECK_FALSE(capture.says("same pixels", options));
  for (const View& view : capture.dataset.views) {
    Image photo = read_image(view.image_path);
    for (int y = 80; y < 90; ++y) {
      for (int x = 55; x < 75; ++x) {
        for (int c = 0; c < 3; ++c) photo.at(x, y, c) = (x / 3 + y / 3) % 2 == 0 ? 1.0f : 0.0f;
      }
    }
    write_image(view.image_path, photo);
  }
  CHECK(capture.says("at the same pixels of all photos", options));
  CHECK(
      capture.says("from 68 to 95 % of their width and from 79 to 91 % of their height", options));
  const std::vector<PhotoArea> areas{{0.65, 0.77, 0.975, 0.93}};
  CHECK(capture.says("--ignore-areas '0.65, 0.77, 0.975, 0.93'", options));
  for (View& view : capture.dataset.views) view.ignored = areas;
  CHECK_FALSE(capture.says("same pixels", options));
}
