// SPDX-License-Identifier: Apache-2.0
// Photos with the same black bars, as the frames of a letterboxed video have.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <utility>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

constexpr int kSize = 48;
constexpr int kBar = 6;

void paint_bars(const fs::path& photo) {
  Image image = read_image(photo);
  const auto channels = static_cast<std::size_t>(image.channels);
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    const std::size_t y = i / channels / kSize;
    const bool alpha = channels == 4 && i % channels == 3;
    if (!alpha && (y < kBar || y >= kSize - kBar)) image.data[i] = 0.0f;
  }
  write_image(photo, image);
}

double trained_psnr(Context& context, Dataset dataset, const fs::path& run) {
  Trainer trainer(context, std::move(dataset), short_training(250), run);
  return trainer.run(false).evaluations.back().psnr;
}

}  // namespace

TEST_CASE("bars of a video cost next to nothing, and very much where they are kept") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const fs::path data = folder.path() / "data";
  make_photos(data, kSize, 16, 4, SyntheticScene::kRoom);
  const double clean = trained_psnr(context, load_dataset(data), folder.path() / "clean");
  for (const View& view : load_dataset(data).views) paint_bars(view.image_path);
  const Dataset barred = load_dataset(data);
  CHECK(std::all_of(barred.views.begin(), barred.views.end(),
                    [](const View& view) { return view.border != nullptr; }));
  const double psnr = trained_psnr(context, barred, folder.path() / "barred");
  DatasetOptions keeping;
  keeping.borders = BorderUse::kKeep;
  const double kept = trained_psnr(context, load_dataset(data, keeping), folder.path() / "kept");
  MESSAGE("clean " << clean << " dB, with bars " << psnr << ", which are kept " << kept);
  CHECK(psnr > clean - 1.0);
  CHECK(kept < psnr - 3.0);
}
