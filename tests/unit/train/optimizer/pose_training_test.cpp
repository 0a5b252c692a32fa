// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "train/capture_geometry.hpp"
#include "train/optimizer/pose_refinement.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

constexpr double kDegree = 3.14159265358979 / 180.0;

/// Every camera turned by `degrees` and moved by `length` in directions of its own, without what
/// these motions have in common: training cannot know that.
std::vector<Camera> disturbed(const std::vector<Camera>& cameras,
                              double degrees,
                              double length,
                              double extent) {
  PoseRefinement motions(cameras, extent, subject_distances(cameras, {}, extent));
  PoseRefinement::State state = motions.state();
  CounterRng rng(17, 0);
  for (std::size_t i = 0; i < state.deltas.size(); i += 3) {
    const double size = i % PoseRefinement::kNumbers == 0 ? degrees * kDegree : length;
    const glm::dvec3 motion =
        size * glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
    for (int k = 0; k < 3; ++k)
      state.deltas[i + static_cast<std::size_t>(k)] = static_cast<float>(motion[k]);
  }
  motions.restore(state);
  motions.step(0, {}, 1e-3);
  return motions.cameras();
}

double degrees_between(const Camera& a, const Camera& b) {
  const glm::dmat3 turn = a.rotation * glm::transpose(b.rotation);
  const double cosine = 0.5 * (turn[0][0] + turn[1][1] + turn[2][2] - 1.0);
  return std::acos(std::clamp(cosine, -1.0, 1.0)) / kDegree;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

}  // namespace

TEST_CASE("disturbed poses of photos come back, and the model with them") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  make_photos(folder.path() / "data", 80, 36, 6, SyntheticScene::kStillLife);
  const Dataset clean = load_dataset(folder.path() / "data");
  Dataset moved = clean;
  std::vector<Camera> truth;
  for (const std::size_t i : clean.indices(Split::kTrain)) truth.push_back(clean.views[i].camera);
  double extent = 0.0;
  for (const Camera& camera : truth)
    extent = std::max(extent, 0.5 * glm::distance(camera.center(), truth[0].center()));
  const std::vector<Camera> start = disturbed(truth, 0.5, 0.01 * extent, extent);
  const std::vector<std::size_t> trained = moved.indices(Split::kTrain);
  for (std::size_t i = 0; i < trained.size(); ++i) moved.views[trained[i]].camera = start[i];
  const auto train = [&](const Dataset& dataset, bool poses, const char* name) {
    TrainOptions options;
    options.iterations = 2000;
    options.eval_renders = 0;
    options.eval_at.clear();
    options.checkpoint_every = 0;
    options.poses = poses;
    Trainer trainer(context, dataset, options, folder.path() / name);
    return trainer.run(false).evaluations.back();
  };
  const double best = train(clean, false, "clean").psnr;
  const double worst = train(moved, false, "moved").psnr;
  const auto row = train(moved, true, "refined");
  const double refined = row.psnr;
  REQUIRE(row.psnr_aligned);
  const double aligned = *row.psnr_aligned;

  std::vector<Camera> cameras = read_cameras(folder.path() / "refined" / "cameras_refined.json");
  std::vector<double> turns, shifts;
  for (const Camera& camera : cameras) {
    const auto found = std::find_if(clean.views.begin(), clean.views.end(), [&](const View& view) {
      return view.camera.name == camera.name;
    });
    REQUIRE(found != clean.views.end());
    CHECK_FALSE(found->test);
    turns.push_back(degrees_between(camera, found->camera));
    shifts.push_back(glm::distance(camera.center(), found->camera.center()) / extent);
  }
  CHECK(cameras.size() == clean.indices(Split::kTrain).size());
  MESSAGE("clean " << best << " dB, disturbed " << worst << ", refined " << refined << ", aligned "
                   << aligned << "; median turn " << median(turns) << " degrees, shift "
                   << 100.0 * median(shifts) << " %");
  // Of six seeds: 0.35 to 0.80 dB below 33.3, 22.1 without; 0.11 to 0.13 degrees, where a pixel is
  // 0.56, and 0.21 to 0.25 %. Of three: 0.02 to 0.08 below where the views held out are aligned.
  // So the model is sharp, and it and its cameras have moved together by what no common motion
  // takes off.
  CHECK(refined > best - 1.0);
  CHECK(aligned > best - 0.3);
  CHECK(refined > worst + 5.0);
  CHECK(median(turns) < 0.17);
  CHECK(median(shifts) < 0.003);
}
