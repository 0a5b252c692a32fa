// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "run/mirror_meshes.hpp"
#include "unit/fixture.hpp"
#include "unit/train/photographed.hpp"
#include "util/atomic_file.hpp"

using namespace raysplats;

namespace {

constexpr int kWidth = 44;
constexpr int kHeight = 36;

double trained_psnr(Photographed& photos, const TrainOptions& options, const std::string& run) {
  Trainer trainer(photos.context, photos.dataset, options, photos.folder / run);
  const TrainSummary summary = trainer.run(false);
  REQUIRE(summary.evaluations.size() == 1);
  return summary.evaluations[0].psnr;
}

TrainOptions small_options(std::int64_t iterations) {
  TrainOptions options;
  options.iterations = iterations;
  options.init_count = 400;
  options.sh_degree = 0;
  options.densify_until = 0;
  options.resolution_schedule = {};
  options.log_every = 50;
  options.eval_at = {};
  options.save_at = {};
  options.checkpoint_every = 0;
  options.trace.memory_budget = std::size_t{64} << 20;
  return options;
}

std::vector<Camera> ring(CameraModel model) {
  std::vector<Camera> cameras;
  for (int i = 0; i < 15; ++i) {
    const double angle = 0.42 * i;
    Camera camera = look_at({2.4 * std::cos(angle), 2.4 * std::sin(angle), 0.8 + 0.05 * i},
                            {0, 0, 0}, {0, 0, 1}, kWidth, kHeight, 48);
    camera.model = model;
    if (model == CameraModel::kFisheye) camera.distortion = {-0.05, 0.02, 0, 0, 0, 0};
    if (model == CameraModel::kOpenCv) camera.distortion = {-0.25, 0.06, 0, 0.004, -0.003, 0};
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace

TEST_CASE("training through a distorted camera reaches nearly what a pinhole reaches") {
  const Gaussians truth = coloured_cloud(60, 0.6, 11);
  double pinhole = 0;
  for (const CameraModel model :
       {CameraModel::kPinhole, CameraModel::kFisheye, CameraModel::kOpenCv}) {
    CAPTURE(static_cast<int>(model));
    Photographed photos(truth, ring(model));
    const TrainOptions options = small_options(150);
    const double before = trained_psnr(photos, small_options(1), "start");
    const double psnr = trained_psnr(photos, options, "run");
    MESSAGE("camera model " << static_cast<int>(model) << ": " << before << " dB, after training "
                            << psnr << " dB");
    if (model == CameraModel::kPinhole) pinhole = psnr;
    CHECK(psnr > before + 6.0);
    CHECK(psnr > pinhole - 1.0);
  }
}

TEST_CASE("what photos show in a known mirror alone is learnt through it") {
  const TemporaryDirectory folder;
  // The cameras look at the mirror, the wall x = 2; the Gaussians are behind them.
  const std::filesystem::path mesh = folder / "mirror.obj";
  write_text_file(mesh,
                  "v 2 -4 -4\nv 2 4 -4\nv 2 4 4\nv 2 -4 4\n"
                  "f 1 2 3\nf 1 3 4\n");
  const Mirrors mirrors = load_mirrors({mesh.string()}, 2);
  CHECK(mirrors.materials.at(0).color == Rgb{1.0f, 1.0f, 1.0f});
  std::vector<Camera> cameras;
  for (int i = 0; i < 12; ++i) {
    const double angle = 0.52 * i;
    cameras.push_back(look_at({1.2, 1.1 * std::cos(angle), 1.1 * std::sin(angle)}, {4.0, 0.0, 0.0},
                              {0, 0, 1}, kWidth, kHeight, 70));
  }
  Photographed photos(coloured_cloud(60, 0.6, 12), cameras, mirrors);
  const Gaussians start = coloured_cloud(400, 0.7, 13);
  write_ply(photos.folder / "start.ply", start);

  TrainOptions options = small_options(1);
  options.init = (photos.folder / "start.ply").string();
  options.mirrors = {mesh.string()};
  const double before = trained_psnr(photos, options, "before");
  options.iterations = 120;
  const double with = trained_psnr(photos, options, "with");
  options.mirrors = {};
  const double without = trained_psnr(photos, options, "without");
  MESSAGE("seen in a mirror alone: " << before << " dB, trained " << with
                                     << " dB, trained without the mirror " << without << " dB");
  CHECK(with > before + 5.0);
  CHECK(with > without + 5.0);
}

TEST_CASE("mirrors that cannot be read are refused") {
  Photographed photos(coloured_cloud(5, 0.5, 14), ring(CameraModel::kPinhole));
  TrainOptions options = small_options(1);
  options.mirrors = {(photos.folder / "none.obj").string()};
  CHECK_THROWS_AS(Trainer(photos.context, photos.dataset, options, photos.folder / "run"),
                  DataError);
}
