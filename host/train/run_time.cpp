// SPDX-License-Identifier: Apache-2.0
#include "train/run_time.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "raysplats/error.hpp"
#include "train/schedule.hpp"

namespace raysplats {
namespace {

constexpr double kOutlier = 3.0;
constexpr std::int64_t kSlices = 400;  // of a run, when its steps are added up
constexpr std::int64_t kMostIterations = 10'000'000;

// The best fit that uses only the terms of `used` (bits 0 to 2), or none that is valid.
bool solve(std::span<const StepSample> samples, unsigned used, glm::dvec3& out) {
  glm::dmat3 normal(0.0);
  glm::dvec3 right(0.0);
  for (const StepSample& s : samples) {
    const glm::dvec3 row = glm::dvec3(1.0, s.pixels, s.gaussians) / s.seconds;
    for (int i = 0; i < 3; ++i) {
      if (!(used >> i & 1u)) continue;
      right[i] += row[i];
      for (int j = 0; j < 3; ++j) {
        if (used >> j & 1u) normal[j][i] += row[i] * row[j];
      }
    }
  }
  // Numbers of very different size: every unknown in units that make its own sum of squares 1.
  glm::dvec3 unit(1.0);
  for (int i = 0; i < 3; ++i) {
    if (used >> i & 1u)
      unit[i] = std::sqrt(normal[i][i]);
    else
      normal[i][i] = 1.0;
  }
  for (int i = 0; i < 3; ++i) {
    if (!(unit[i] > 0)) return false;
    right[i] /= unit[i];
    for (int j = 0; j < 3; ++j) normal[j][i] /= unit[i] * unit[j];
  }
  if (std::abs(glm::determinant(normal)) < 1e-9) return false;
  out = glm::inverse(normal) * right / unit;
  return out.x >= 0 && out.y >= 0 && out.z >= 0;
}

double error_of(std::span<const StepSample> samples, const glm::dvec3& terms) {
  double sum = 0;
  for (const StepSample& s : samples) {
    const double relative =
        (terms.x + terms.y * s.pixels + terms.z * s.gaussians) / s.seconds - 1.0;
    sum += relative * relative;
  }
  return sum;
}

// Of all choices of terms without a negative one the best: least squares under that condition.
StepCost fit(std::span<const StepSample> samples) {
  glm::dvec3 best(0.0);
  double least = error_of(samples, best);
  for (unsigned used = 1; used < 8; ++used) {
    glm::dvec3 terms;
    if (!solve(samples, used, terms)) continue;
    const double error = error_of(samples, terms);
    if (error < least) least = error, best = terms;
  }
  return {best.x, best.y, best.z};
}

}  // namespace

StepCost fit_step_cost(std::span<const StepSample> samples) {
  std::vector<StepSample> sound;
  for (const StepSample& s : samples) {
    if (s.seconds > 0) sound.push_back(s);
  }
  if (sound.empty()) throw UsageError("No step was timed: there is nothing to estimate from");
  const StepCost all = fit(sound);
  std::vector<StepSample> usual;
  for (const StepSample& s : sound) {
    if (s.seconds <= kOutlier * all.seconds(s.pixels, s.gaussians)) usual.push_back(s);
  }
  return usual.empty() ? all : fit(usual);
}

double expected_gaussians(const TrainOptions& options,
                          std::int64_t iteration,
                          double first,
                          double limit) {
  const auto from = static_cast<double>(options.densify_from.of(options.iterations));
  const auto until = static_cast<double>(options.densify_until.of(options.iterations));
  if (until <= from || limit <= first) return first;
  const double x = std::clamp((static_cast<double>(iteration) - from) / (until - from), 0.0, 1.0);
  return limit - (limit - first) * (1.0 - x) * (1.0 - x);
}

double run_seconds(
    const TrainOptions& options, const StepCost& cost, double pixels, double first, double limit) {
  const std::int64_t slices = std::min(kSlices, options.iterations);
  double sum = 0;
  for (std::int64_t k = 0; k < slices; ++k) {
    const std::int64_t begin = k * options.iterations / slices;
    const std::int64_t end = (k + 1) * options.iterations / slices;
    const std::int64_t middle = (begin + end) / 2;
    const double divisor = resolution_divisor(options, middle);
    sum += static_cast<double>(end - begin) *
           cost.seconds(pixels / (divisor * divisor),
                        expected_gaussians(options, middle, first, limit));
  }
  return sum;
}

std::int64_t iterations_within(double seconds,
                               std::int64_t least,
                               const std::function<double(std::int64_t)>& seconds_of) {
  std::int64_t low = least, high = kMostIterations;
  while (low < high) {
    const std::int64_t middle = low + (high - low + 1) / 2;
    if (seconds_of(middle) <= seconds) {
      low = middle;
    } else {
      high = middle - 1;
    }
  }
  return low;
}

}  // namespace raysplats
