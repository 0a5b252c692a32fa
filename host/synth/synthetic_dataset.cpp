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
#include <vector>

#include "base/atomic_file.hpp"
#include "base/output_directory.hpp"
#include "base/rng.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "synth/scene.hpp"

namespace raysplats {

namespace {

constexpr const char* kGenerator = "raysplats";
constexpr double kFieldOfView = 0.69;  ///< radians, horizontal and vertical
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

void write_transforms(const std::filesystem::path& path, const std::vector<Camera>& cameras) {
  nlohmann::ordered_json file;
  file["generator"] = kGenerator;
  file["camera_angle_x"] = kFieldOfView;
  file["frames"] = nlohmann::ordered_json::array();
  for (const Camera& camera : cameras) {
    nlohmann::ordered_json frame;
    frame["file_path"] = "./" + camera.name;
    frame["transform_matrix"] = transform_matrix(camera);
    file["frames"].push_back(std::move(frame));
  }
  write_text_file(path, file.dump(1) + "\n");
}

/// Renders and writes the images on all cores; the first failure stops the others and is thrown.
void render_all(const std::filesystem::path& directory,
                const synth::Scene& scene,
                const std::vector<Camera>& cameras) {
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < cameras.size(); i = next++) {
        write_image(directory / (cameras[i].name + ".png"), synth::render(scene, cameras[i]));
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

/// A folder is new, empty or has an earlier data set of ours.
void check_replaceable(const std::filesystem::path& directory) {
  std::error_code error;
  if (!std::filesystem::is_directory(directory, error)) return;
  if (std::filesystem::is_empty(directory, error)) return;
  std::ifstream stream(directory / "transforms_train.json");
  const auto file = nlohmann::json::parse(stream, nullptr, false);
  if (file.is_object() && file.value("generator", nlohmann::json()) == kGenerator) return;
  throw UsageError(fmt::format(
      "The folder {} holds other files: choose a new one, or write there with --overwrite",
      directory.string()));
}

}  // namespace

void generate_dataset(const std::filesystem::path& directory,
                      const SyntheticOptions& options,
                      bool overwrite) {
  check_range("image size", options.size, 8, 4096);
  check_range("number of training views", options.train_views, 1, 10000);
  check_range("number of test views", options.test_views, 1, 10000);
  const double turn = 2.0 * std::numbers::pi * CounterRng(options.seed, 2).uniform();
  const std::vector<Camera> train =
      spread_cameras("train", options.train_views, options.size, turn);
  const std::vector<Camera> test =
      spread_cameras("test", options.test_views, options.size,
                     best_turn(train, options.test_views, options.size, turn));

  if (!overwrite) check_replaceable(directory);
  make_output_directory(directory / "train");
  make_output_directory(directory / "test");
  std::vector<Camera> all = train;
  all.insert(all.end(), test.begin(), test.end());
  render_all(directory, synth::make_still_life(options.seed), all);
  // Last, so that an interrupted run is not taken for a data set.
  write_transforms(directory / "transforms_train.json", train);
  write_transforms(directory / "transforms_test.json", test);
}

}  // namespace raysplats
