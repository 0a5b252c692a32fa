// SPDX-License-Identifier: Apache-2.0
#include "synth/synthetic_dataset.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <fstream>
#include <future>
#include <glm/matrix.hpp>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "synth/backdrop.hpp"
#include "synth/scene.hpp"
#include "util/atomic_file.hpp"
#include "util/output_directory.hpp"
#include "util/rng.hpp"

namespace raysplats {

namespace {

constexpr const char* kGenerator = "raysplats";
constexpr double kFieldOfView = 0.69;     ///< radians, horizontal and vertical
constexpr double kWideFieldOfView = 1.0;  ///< of captures with a backdrop
constexpr double kDistance = 4.0;
constexpr double kGoldenAngle = 2.399963229728653;

void check_range(const char* name, int value, int least, int most) {
  if (value < least || value > most) {
    throw UsageError(fmt::format("The generator's {} is {}, give a number from {} to {}.", name,
                                 value, least, most));
  }
}

/// `count` cameras on a Fibonacci lattice (Swinbank and Purser 2006) over the upper part of a
/// sphere.
std::vector<Camera> spread_cameras(const std::string& split, int count, int size, double turn) {
  constexpr double kLowest = 0.10;   // sine of the elevation
  constexpr double kHighest = 0.95;  // steeper views would show the table alone
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double height = kLowest + (kHighest - kLowest) * (i + 0.5) / count;
    const double across = std::sqrt(1.0 - height * height);
    const double azimuth = turn + i * kGoldenAngle;
    const glm::dvec3 eye =
        kDistance * glm::dvec3(across * std::cos(azimuth), across * std::sin(azimuth), height);
    cameras.push_back(look_at(eye, glm::dvec3(0.0), glm::dvec3(0, 0, 1), size, size,
                              0.5 * size / std::tan(0.5 * kFieldOfView)));
    cameras.back().name = fmt::format("{}/r_{}", split, i);
  }
  return cameras;
}

/// Where the cameras of a capture with a backdrop stand and what they look at.
struct Stand {
  glm::dvec3 eye, target;
};

/// `u` and `v` in [0, 1).
Stand stand_of(SyntheticScene scene, double u, double v) {
  const double angle = 2.0 * std::numbers::pi * u;
  const glm::dvec3 around(std::cos(angle), std::sin(angle), 0.0);
  if (scene == SyntheticScene::kForward)
    return {{2.4 * u - 1.2, -3.4, 1.4 * v - 0.3}, {0.3 * (u - 0.5), 1.0, 0.0}};
  if (scene == SyntheticScene::kRoom)
    return {2.3 * around + glm::dvec3(0, 0, 1.6 * v - 0.4), glm::dvec3(0, 0, 0.4 * (0.5 - v))};
  return {3.2 * around + glm::dvec3(0, 0, 1.1 * v - 0.3), {0.0, 0.0, 0.2}};
}

/// `count` cameras of a capture with a backdrop: a sequence of low discrepancy (R2, Roberts 2018)
/// from a start of its own.
std::vector<Camera> backdrop_cameras(const SyntheticOptions& options,
                                     const std::string& split,
                                     int count,
                                     double start) {
  const double focal = 0.5 * options.size / std::tan(0.5 * kWideFieldOfView);
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double u = start + 0.7548776662466927 * i;
    const double v = start + 0.5698402909980532 * i;
    const Stand stand = stand_of(options.scene, u - std::floor(u), v - std::floor(v));
    cameras.push_back(
        look_at(stand.eye, stand.target, glm::dvec3(0, 0, 1), options.size, options.size, focal));
    cameras.back().name = fmt::format("{}/r_{}", split, i);
  }
  return cameras;
}

synth::Backdrop backdrop_of(const SyntheticOptions& options) {
  switch (options.scene) {
    case SyntheticScene::kForward:
      return synth::painted_wall(options.seed);
    case SyntheticScene::kRoom:
      return synth::papered_room(options.seed);
    case SyntheticScene::kOutdoor:
      return synth::open_country(options.seed);
    case SyntheticScene::kStillLife:
      break;
  }
  return {};
}

/// Angle to add to the azimuth of all test views that keeps them farthest from every training view.
double best_turn(const std::vector<Camera>& train, int test_views, int size, double first) {
  constexpr int kCandidates = 48;
  double best = first;
  double best_gap = -1.0;
  for (int k = 0; k < kCandidates; ++k) {
    const double turn = first + 2.0 * std::numbers::pi * k / kCandidates;
    double gap = kDistance;
    for (const Camera& test : spread_cameras("test", test_views, size, turn)) {
      for (const Camera& other : train) {
        gap = std::min(gap, glm::length(test.center() - other.center()));
      }
    }
    if (gap > best_gap) {
      best_gap = gap;
      best = turn;
    }
  }
  return best;
}

/// Camera to world with OpenGL's axes (x right, y up, z backward).
nlohmann::json transform_matrix(const Camera& camera) {
  const glm::dmat3 axes = glm::transpose(camera.rotation);
  const glm::dvec3 center = camera.center();
  nlohmann::json rows = nlohmann::json::array();
  for (int r = 0; r < 3; ++r) rows.push_back({axes[0][r], -axes[1][r], -axes[2][r], center[r]});
  rows.push_back({0.0, 0.0, 0.0, 1.0});
  return rows;
}

nlohmann::ordered_json frame_of(const Camera& camera, const std::string& extension) {
  nlohmann::ordered_json frame;
  frame["file_path"] = "./" + camera.name + extension;
  frame["transform_matrix"] = transform_matrix(camera);
  return frame;
}

void write_transforms(const std::filesystem::path& path, const std::vector<Camera>& cameras) {
  nlohmann::ordered_json file;
  file["generator"] = kGenerator;
  file["camera_angle_x"] = kFieldOfView;
  file["frames"] = nlohmann::ordered_json::array();
  for (const Camera& camera : cameras) {
    file["frames"].push_back(frame_of(camera, ""));
  }
  write_text_file(path, file.dump(1) + "\n");
}

/// nerfstudio's file, which names the views of both splits.
void write_capture(const std::filesystem::path& path,
                   const std::vector<Camera>& train,
                   const std::vector<Camera>& test) {
  const Camera& first = train.front();
  nlohmann::ordered_json file{{"generator", kGenerator}, {"camera_model", "PINHOLE"},
                              {"w", first.width},        {"h", first.height},
                              {"fl_x", first.fx},        {"fl_y", first.fy},
                              {"cx", first.cx},          {"cy", first.cy}};
  file["frames"] = nlohmann::ordered_json::array();
  for (const auto& [key, cameras] :
       {std::pair{"train_filenames", &train}, std::pair{"test_filenames", &test}}) {
    file[key] = nlohmann::ordered_json::array();
    for (const Camera& camera : *cameras) {
      file["frames"].push_back(frame_of(camera, ".png"));
      file[key].push_back("./" + camera.name + ".png");
    }
  }
  write_text_file(path, file.dump(1) + "\n");
}

/// The picture without its alpha.
Image opaque(const Image& rgba) {
  const float black[3] = {0, 0, 0};
  return composite(rgba, black);
}

/// Renders and writes the images on all cores; the first failure stops the others and is thrown.
void render_all(const std::filesystem::path& directory,
                const synth::Scene& scene,
                const std::vector<Camera>& cameras,
                bool transparent) {
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < cameras.size(); i = next++) {
        const Image picture = synth::render(scene, cameras[i]);
        write_image(directory / (cameras[i].name + ".png"),
                    transparent ? picture : opaque(picture));
      }
    } catch (...) {
      next = cameras.size();
      throw;
    }
  };
  std::vector<std::future<void>> workers;
  const std::size_t threads =
      std::min<std::size_t>(std::max(1u, std::thread::hardware_concurrency()), cameras.size());
  for (std::size_t i = 0; i < threads; ++i) workers.push_back(std::async(std::launch::async, work));
  for (std::future<void>& worker : workers) worker.wait();
  for (std::future<void>& worker : workers) worker.get();
}

/// Tells a data set that is not whole, until its cameras are written.
constexpr const char* kUnfinished = "unfinished.json";

/// Whether the file is of an earlier data set of ours.
bool is_ours(const std::filesystem::path& path) {
  std::ifstream stream(path);
  const auto file = nlohmann::json::parse(stream, nullptr, false);
  return file.is_object() && file.value("generator", nlohmann::json()) == kGenerator;
}

/// A folder is new, empty or has an earlier data set of ours.
void check_replaceable(const std::filesystem::path& directory) {
  std::error_code error;
  if (!std::filesystem::is_directory(directory, error)) return;
  if (std::filesystem::is_empty(directory, error)) return;
  for (const char* name : {"transforms_train.json", "transforms.json", kUnfinished}) {
    if (is_ours(directory / name)) return;
  }
  throw UsageError(fmt::format(
      "The folder {} holds other files: choose a new one, or write there with --overwrite",
      directory.string()));
}

/// Camera files of an earlier data set would be taken for those of the pictures that take its
/// place.
void remove_cameras(const std::filesystem::path& directory) {
  for (const char* name : {"transforms.json", "transforms_train.json", "transforms_test.json"}) {
    if (is_ours(directory / name)) std::filesystem::remove(directory / name);
  }
}

}  // namespace

void generate_dataset(const std::filesystem::path& directory,
                      const SyntheticOptions& options,
                      bool overwrite) {
  check_range("image size", options.size, 8, 4096);
  check_range("number of training views", options.train_views, 1, 10000);
  check_range("number of test views", options.test_views, 1, 10000);
  const double start = CounterRng(options.seed, 2).uniform();
  const double turn = 2.0 * std::numbers::pi * start;
  const bool transparent = options.scene == SyntheticScene::kStillLife;
  const std::vector<Camera> train =
      transparent ? spread_cameras("train", options.train_views, options.size, turn)
                  : backdrop_cameras(options, "train", options.train_views, start);
  const std::vector<Camera> test =
      transparent ? spread_cameras("test", options.test_views, options.size,
                                   best_turn(train, options.test_views, options.size, turn))
                  : backdrop_cameras(options, "test", options.test_views, start + 0.5);

  if (!overwrite) check_replaceable(directory);
  make_output_directory(directory / "train");
  make_output_directory(directory / "test");
  write_text_file(directory / kUnfinished, nlohmann::json{{"generator", kGenerator}}.dump() + "\n");
  remove_cameras(directory);
  std::vector<Camera> all = train;
  all.insert(all.end(), test.begin(), test.end());
  render_all(directory, synth::make_still_life(options.seed, backdrop_of(options)), all,
             transparent);
  // Last, so that an interrupted run is not taken for a data set.
  if (transparent) {
    write_transforms(directory / "transforms_train.json", train);
    write_transforms(directory / "transforms_test.json", test);
  } else {
    write_capture(directory / "transforms.json", train, test);
  }
  std::filesystem::remove(directory / kUnfinished);
}

}  // namespace raysplats
