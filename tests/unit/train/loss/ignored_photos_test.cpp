// SPDX-License-Identifier: Apache-2.0
#include "train/ignored_photos.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "unit/log_capture.hpp"
#include "unit/temporary_directory.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

/// Six views without files of photos, the last two of them held out.
Dataset six_views() {
  Dataset dataset;
  dataset.root = "data";
  for (int i = 0; i < 6; ++i) {
    View view;
    view.camera.name = fmt::format("{}.png", i);
    view.test = i > 3;
    dataset.views.push_back(view);
  }
  return dataset;
}

std::vector<std::string> names(const Dataset& dataset) {
  std::vector<std::string> out;
  for (const View& view : dataset.views) out.push_back(view.camera.name);
  return out;
}

fs::path write_mask(const fs::path& path, float corner) {
  Image mask(5, 4, 1, 0.0f);
  mask.at(4, 3, 0) = corner;
  write_image(path, mask);
  return path;
}

std::string error_of(const Dataset& dataset) {
  try {
    without_ignored_photos(dataset);
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("views of black masks leave a data set, and one warning counts them") {
  const TemporaryDirectory folder;
  Dataset dataset = six_views();
  const auto kept = [&] { return names(without_ignored_photos(dataset)); };
  const LogCapture log;
  CHECK(kept() == names(dataset));
  const fs::path black = write_mask(folder.path() / "black.png", 0.0f);
  dataset.views[0].mask_path = write_mask(folder.path() / "corner.png", 1.0f);
  CHECK(kept() == names(dataset));
  // A photo that shows nothing of a body that masks cut out tells where that is not.
  dataset.views[1].mask_path = black;
  dataset.views[1].mask_cuts = true;
  CHECK(kept() == names(dataset));
  CHECK(log.lines() == 0);
  for (const std::size_t i : {2u, 3u, 5u}) dataset.views[i].mask_path = black;
  CHECK(kept() == std::vector<std::string>{"0.png", "1.png", "4.png"});
  CHECK(log.lines() == 1);
  CHECK(log.contains("3 of 6 photos are left out"));
  CHECK(log.contains("black.png"));
}

TEST_CASE("a data set whose training photos masks all ignore, or a broken mask, is an error") {
  const TemporaryDirectory folder;
  Dataset dataset = six_views();
  const fs::path black = write_mask(folder.path() / "black.png", 0.0f);
  for (std::size_t i = 0; i < 4; ++i) dataset.views[i].mask_path = black;
  const std::string message = error_of(dataset);
  CHECK(message.find("masks of all 4 training photos of data are black everywhere") !=
        std::string::npos);
  // Held-out views alone may go.
  for (std::size_t i = 0; i < 4; ++i) dataset.views[i].mask_path.clear();
  dataset.views[4].mask_path = dataset.views[5].mask_path = black;
  CHECK(without_ignored_photos(dataset).views.size() == 4);
  const fs::path broken = folder.path() / "broken.png";
  std::ofstream(broken) << "no picture";
  dataset.views[2].mask_path = broken;
  CHECK(error_of(dataset).find("broken.png") != std::string::npos);
}
