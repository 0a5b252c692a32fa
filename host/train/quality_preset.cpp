// SPDX-License-Identifier: Apache-2.0
#include "train/quality_preset.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"
#include "scene/statistics.hpp"
#include "train/schedule.hpp"

namespace raysplats {
namespace {

struct Level {
  std::int64_t passes;       // over the training photos
  std::int64_t least, most;  // iterations
  int side;                  // longest side of the usual photo on CPUs, in pixels
};

constexpr std::array<Level, 4> kLevels{{{4, 300, 1000, 240},
                                        {12, 1000, 3000, 400},
                                        {40, 3000, 10000, 800},
                                        {120, 10000, 30000, 1600}}};
constexpr int kFasterDevices = 2;  // times that side elsewhere

constexpr double kLongestSide = 1600;
constexpr double kSideOfSecond = 100;  // on CPUs; steps cost as pixels do
constexpr double kLeastSide = 640;     // that a short time makes of it
constexpr double kLeastDownscale = 1.25;

// Longest side of the usual photo to train on: a panorama among phone photos must not shrink them
// all. That of a strip is one of as many pixels of the shape 2:1, since steps cost as pixels do.
int longest_side(const Dataset& dataset) {
  std::vector<double> sides;
  for (const std::size_t i : dataset.indices(Split::kTrain)) {
    const Camera& camera = dataset.views[i].camera;
    const double side = std::max(camera.width, camera.height);
    sides.push_back(std::min(side, std::sqrt(2.0 * static_cast<double>(pixel_count(camera)))));
  }
  return sides.empty() ? 1 : std::max(1, static_cast<int>(median(std::move(sides))));
}

}  // namespace

const std::vector<std::string>& quality_names() {
  static const std::vector<std::string> names{"preview", "low", "medium", "high"};
  return names;
}

Quality parse_quality(const std::string& name) {
  const std::vector<std::string>& names = quality_names();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) {
    throw UsageError(
        fmt::format("The option 'quality' is {}, not '{}'", fmt::join(names, " or "), name));
  }
  return static_cast<Quality>(found - names.begin());
}

QualityChoice choose_quality(Quality quality, const Dataset& dataset, DeviceType device) {
  const Level& level = kLevels[static_cast<std::size_t>(quality)];
  const std::size_t views = dataset.indices(Split::kTrain).size();
  const int longest = longest_side(dataset);
  const int side = level.side * (device == DeviceType::kCpu ? 1 : kFasterDevices);
  QualityChoice out;
  // Few photos are known by heart before the least of a level is over.
  const std::int64_t least = std::min(level.least, usual_length(views));
  out.iterations = std::clamp(level.passes * static_cast<std::int64_t>(views), least, level.most);
  out.downscale = (longest + side - 1) / side;
  return out;
}

double fitting_downscale(const Dataset& dataset, DeviceType device, std::optional<double> seconds) {
  double side = kLongestSide;
  if (seconds) {
    const double faster = device == DeviceType::kCpu ? 1 : kFasterDevices;
    side = std::clamp(faster * kSideOfSecond * std::sqrt(*seconds), kLeastSide, side);
  }
  const double factor = longest_side(dataset) / side;
  return factor >= kLeastDownscale ? factor : 1.0;
}

}  // namespace raysplats
