// SPDX-License-Identifier: Apache-2.0
#include "eval/kept_pictures.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "raysplats/evaluation.hpp"
#include "raysplats/io.hpp"
#include "unit/temporary_directory.hpp"

using namespace raysplats;

namespace {

constexpr int kSize = 24;
constexpr std::size_t kBytes = sizeof(float) * 4 * (kSize / 2) * (kSize / 2);

// Test photos that are reduced to half of their size.
struct Photos {
  TemporaryDirectory folder;
  Dataset dataset;

  explicit Photos(int count) {
    dataset.root = folder.path();
    for (int i = 0; i < count; ++i) {
      View view;
      view.camera.name = "view_" + std::to_string(i) + ".png";
      view.camera.width = view.camera.height = kSize;
      view.camera.fx = view.camera.fy = 20;
      view.camera.cx = view.camera.cy = kSize / 2.0;
      view.source_camera = view.camera;
      view.camera = downscaled(view.source_camera, 2);
      view.image_path = folder / view.camera.name;
      view.test = true;
      dataset.views.push_back(view);
      write(static_cast<std::size_t>(i), 0.01f);
    }
  }
  void write(std::size_t view, float slope) const {
    Image photo(kSize, kSize, 3);
    for (std::size_t i = 0; i < photo.data.size(); ++i)
      photo.data[i] = 0.2f + slope * static_cast<float>((i + 7 * view) % 60);
    write_image(dataset.views[view].image_path, photo);
  }
};

Image grey(const Camera& camera) { return {camera.width, camera.height, 3, 0.5f}; }

}  // namespace

TEST_CASE("the photos that fit the budget are read once, the others each time [tiny]") {
  const Photos photos(3);
  const std::vector<View>& views = photos.dataset.views;
  KeptPictures kept(2 * kBytes);
  std::vector<Image> before;
  for (std::size_t i = 0; i < views.size(); ++i) {
    before.push_back(kept.get(i, views[i])->rgba);
    CHECK(before[i].data == load_view_picture(views[i]).rgba.data);
  }
  CHECK(kept.kept_bytes() == 2 * kBytes);
  for (std::size_t i = 0; i < views.size(); ++i) {
    photos.write(i, 0.005f);
    CHECK((kept.get(i, views[i])->rgba.data == before[i].data) == (i < 2));
  }
  CHECK(kept.kept_bytes() == 2 * kBytes);
}

TEST_CASE("an evaluation of photos that are kept has the numbers of one that reads them [tiny]") {
  const Photos photos(3);
  KeptPictures kept(2 * kBytes);
  EvaluationOptions keeping;
  keeping.photo = [&](std::size_t view) { return kept.get(view, photos.dataset.views[view]); };
  const EvaluationReport plain = evaluate(grey, photos.dataset, Split::kTest, {0, 0, 0});
  for (int time = 0; time < 2; ++time) {
    const EvaluationReport report =
        evaluate(grey, photos.dataset, Split::kTest, {0, 0, 0}, {}, keeping);
    CHECK(report.json() == plain.json());
  }
}
