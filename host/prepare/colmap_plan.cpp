// SPDX-License-Identifier: Apache-2.0
#include "prepare/colmap_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <thread>
#include <tuple>
#include <utility>

#include "io/image/image_file.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kFewestForAxis = 10;
constexpr std::size_t kBlock = 20;  ///< small, so that the bar moves

// Comparing two photos takes the product of their features: the more pairs, the fewer features.
int features_for(std::size_t photos, bool sequential) {
  if (photos <= 100) return 8192;
  return sequential || photos <= 200 ? 4096 : 2048;
}

// Seconds of one core, measured with COLMAP 3.8 on photos of textured scenes.
ColmapSeconds seconds_for(const ColmapPlan& plan, double megapixels, double pairs) {
  constexpr double kPerMegapixel = 2.0;
  constexpr double kFeaturesPerMegapixel = 8000;
  constexpr double kPerFeaturePair = 9e-8;
  constexpr double kPerPair = 0.01;
  constexpr double kPerFeaturePlaced = 7e-5;
  const auto photos = static_cast<double>(plan.photos);
  const double found =
      std::min(static_cast<double>(plan.features), kFeaturesPerMegapixel * megapixels / photos);
  const double cores = std::max(1u, std::thread::hardware_concurrency());
  return {kPerMegapixel * megapixels / cores,
          pairs * (kPerPair + kPerFeaturePair * found * found) / cores,
          kPerFeaturePlaced * found * std::pow(photos, 1.5) / cores};
}

}  // namespace

ColmapPlan plan_colmap(const std::filesystem::path& images,
                       const std::vector<std::string>& photos,
                       const PrepareOptions& options,
                       bool video) {
  ColmapPlan plan;
  plan.photos = photos.size();
  const bool sequential =
      options.matching == Matching::kSequential ||
      (options.matching == Matching::kAuto && (video || plan.photos > kMostExhaustive));
  const std::size_t blocks = (plan.photos + kBlock - 1) / kBlock;
  double pairs = 0;
  if (sequential) {
    plan.matcher = {"sequential_matcher", "--SequentialMatching.overlap",
                    std::to_string(kSequentialOverlap)};
    plan.match_lines = plan.photos;
    pairs = static_cast<double>(kSequentialOverlap * plan.photos);
  } else {
    plan.matcher = {"exhaustive_matcher", "--ExhaustiveMatching.block_size",
                    std::to_string(kBlock)};
    plan.match_lines = blocks * blocks;
    pairs = 0.5 * static_cast<double>(plan.photos * (plan.photos - 1));
  }
  plan.features = options.features > 0 ? options.features : features_for(plan.photos, sequential);

  const bool shared = options.cameras != Cameras::kPhoto;
  using Camera = std::tuple<int, int, std::string>;
  std::map<Camera, std::vector<std::string>> by_camera;
  double megapixels = 0;
  for (const std::string& name : photos) {
    const io::ImageSize size = io::image_size(images / name);
    const bool own = options.cameras == Cameras::kFolder;
    const std::string folder = own ? std::filesystem::path(name).parent_path().string() : "";
    by_camera[shared ? Camera(size.width, size.height, folder) : Camera()].push_back(name);
    const double shrunk =
        std::min(1.0, static_cast<double>(options.max_size) / std::max(size.width, size.height));
    megapixels += 1e-6 * size.width * size.height * shrunk * shrunk;
  }
  plan.finds_axis = shared && std::all_of(by_camera.begin(), by_camera.end(), [](const auto& each) {
                      return each.second.size() >= kFewestForAxis;
                    });
  for (auto& [camera, names] : by_camera) plan.cameras.push_back(std::move(names));
  plan.feature_settings = fmt::format("{} {} {} {}\n", options.camera_model, options.max_size,
                                      plan.features, static_cast<int>(options.cameras));
  plan.seconds = seconds_for(plan, megapixels, pairs);
  return plan;
}

}  // namespace raysplats
