// SPDX-License-Identifier: Apache-2.0
#include "train/start/photo_set.hpp"

#include <doctest/doctest.h>

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "raysplats/io.hpp"
#include "unit/temporary_directory.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using namespace raysplats::test;

TEST_CASE("reading photos shows how far it is once it has taken long, and never without a stream") {
  const TemporaryDirectory folder;
  Dataset dataset;
  for (int i = 0; i < 4; ++i) {
    View view;
    view.camera.width = view.source_camera.width = 16;
    view.camera.height = view.source_camera.height = 12;
    view.image_path = folder / (std::to_string(i) + ".png");
    write_image(view.image_path, Image(16, 12, 3, 0.2f * static_cast<float>(i)));
    dataset.views.push_back(view);
  }
  const std::vector<std::size_t> views{3, 0, 2};
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::tmpfile(), &std::fclose);
  REQUIRE(file);
  const auto told = [&](const ReadingProgress& progress) {
    const std::vector<SmallPhoto> photos = load_small_photos(dataset, views, 8, progress);
    REQUIRE(photos.size() == 3);
    for (std::size_t i = 0; i < photos.size(); ++i) {
      CHECK(photos[i].picture->width == 8);
      CHECK(photos[i].camera.height == 6);
      CHECK(photos[i].color(3, 3)[0] ==
            doctest::Approx(0.2 * static_cast<double>(views[i])).epsilon(0.02));
    }
    std::rewind(file.get());
    std::string text(1000, '\0');
    text.resize(std::fread(text.data(), 1, text.size(), file.get()));
    return text;
  };
  CHECK(told({}).empty());
  CHECK(told({file.get(), 1e9}).empty());
  const std::string text = told({file.get(), 0});
  CHECK(contains(text, "Reading photos"));
  CHECK(contains(text, "/3"));
}
