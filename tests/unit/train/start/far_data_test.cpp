// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/trainer.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

/// Moves the cameras of a generated data set, and the scene with them.
void move_data(const fs::path& folder, const std::array<double, 3>& by) {
  for (const char* name : {"transforms_train.json", "transforms_test.json"}) {
    nlohmann::json json = nlohmann::json::parse(std::ifstream(folder / name));
    for (nlohmann::json& frame : json.at("frames")) {
      for (std::size_t k = 0; k < 3; ++k) {
        nlohmann::json& number = frame.at("transform_matrix").at(k).at(3);
        number = number.get<double>() + by[k];
      }
    }
    std::ofstream(folder / name) << json;
  }
}

}  // namespace

TEST_CASE("a scene far from the origin of its files trains as it would at home") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const auto train = [&](const char* name, const DatasetOptions& data) {
    TrainOptions options = short_training(300);
    options.data = data;
    Trainer trainer(context, load_dataset(folder.path() / "data", data), options,
                    folder.path() / name);
    return trainer.run(false).evaluations.back().psnr;
  };
  make_photos(folder.path() / "data", 64, 24, 6);
  const double home = train("home", {});
  move_data(folder.path() / "data", {4.2e6, -3.1e5, 4.8e6});
  const double far = train("far", {});
  DatasetOptions as_it_is;
  as_it_is.origin.emplace();
  const double blurred = train("blurred", as_it_is);
  MESSAGE("home " << home << " dB, far " << far << ", far without another origin " << blurred);
  CHECK(far > home - 0.3);
  CHECK(blurred < home - 3.0);
}
