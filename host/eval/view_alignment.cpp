// SPDX-License-Identifier: Apache-2.0
#include "eval/view_alignment.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <utility>

#include "scene/camera/camera_model.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kNumbers = 6;  // a turn about the camera's axes, then a shift of its centre
constexpr double kStepPixels = 0.1;  // how far the picture moves for a slope
constexpr int kShiftTries = 4;       // to find the shift that moves it as far
constexpr int kMostSteps = 32;       // that are tried: 12 at most where poses are 0.5 degrees off
constexpr double kLeastGain = 5e-4;  // of the error by a step; a smaller one is the last
constexpr double kFirstDamping = 1e-3;  // of the diagonal

using Numbers = std::array<double, kNumbers>;
using Matrix = std::array<Numbers, kNumbers>;

Camera moved_by(const Camera& camera, const Numbers& by) {
  return moved(camera, {by[0], by[1], by[2]}, {by[3], by[4], by[5]});
}

Camera moved_by(const Camera& camera, std::size_t number, double length) {
  Numbers by{};
  by[number] = length;
  return moved_by(camera, by);
}

// The angle of kStepPixels in the middle of the picture.
double step_turn(const Camera& camera) {
  const double x = 0.5 * camera.width, y = 0.5 * camera.height;
  const CameraRay a = camera_ray(camera, x, y);
  const CameraRay b = camera_ray(camera, x + kStepPixels, y);
  const double sine = glm::length(glm::cross(a.direction, b.direction));
  // Rays of an orthographic camera have no angle between them.
  return sine > 0.0 ? std::asin(std::min(sine, 1.0)) : kStepPixels / camera.width;
}

// Calls visit(i, weight, k) for every number of three channels that counts: number i of the
// photo's, k of the render's, which may have more channels.
template <class Visit>
void for_all_numbers(const Image& photo, const Image& weight, int channels, const Visit& visit) {
  const auto own = static_cast<std::size_t>(photo.channels);
  const auto theirs = static_cast<std::size_t>(channels);
  for (std::size_t p = 0; p < photo.pixels(); ++p) {
    const auto w = static_cast<double>(weight.data[p]);
    if (w <= 0.0) continue;
    for (std::size_t c = 0; c < 3; ++c) visit(own * p + c, w, theirs * p + c);
  }
}

double squared_error(const Image& render, const Image& photo, const Image& weight) {
  double sum = 0;
  for_all_numbers(photo, weight, render.channels, [&](std::size_t i, double w, std::size_t k) {
    const double e = static_cast<double>(render.data[k]) - static_cast<double>(photo.data[i]);
    sum += w * e * e;
  });
  return sum;
}

double squared_change(const Image& a, const Image& b, const Image& photo, const Image& weight) {
  double sum = 0;
  for_all_numbers(photo, weight, a.channels, [&](std::size_t, double w, std::size_t k) {
    const double e = static_cast<double>(a.data[k]) - static_cast<double>(b.data[k]);
    sum += w * e * e;
  });
  return sum;
}

// x of (matrix + damping of its diagonal) x = right, by elimination: the matrix is positive.
Numbers solve(Matrix matrix, Numbers right, double damping) {
  double largest = 0.0;
  for (std::size_t k = 0; k < kNumbers; ++k) largest = std::max(largest, matrix[k][k]);
  for (std::size_t k = 0; k < kNumbers; ++k)
    matrix[k][k] += damping * matrix[k][k] + 1e-12 * largest + 1e-300;
  for (std::size_t k = 0; k < kNumbers; ++k) {
    for (std::size_t i = k + 1; i < kNumbers; ++i) {
      const double factor = matrix[i][k] / matrix[k][k];
      for (std::size_t j = k; j < kNumbers; ++j) matrix[i][j] -= factor * matrix[k][j];
      right[i] -= factor * right[k];
    }
  }
  for (std::size_t k = kNumbers; k-- > 0;) {
    for (std::size_t j = k + 1; j < kNumbers; ++j) right[k] -= matrix[k][j] * right[j];
    right[k] /= matrix[k][k];
  }
  return right;
}

struct NormalEquations {
  Matrix matrix{};  // J^T W J, with the slopes of the picture as J
  Numbers right{};  // J^T W times what the picture lacks
};

// By how much the squared error falls with a step where pictures follow their slopes.
double expected_gain(const NormalEquations& equations, const Numbers& step) {
  double gain = 0.0;
  for (std::size_t a = 0; a < kNumbers; ++a) {
    gain += 2.0 * step[a] * equations.right[a];
    for (std::size_t b = 0; b < kNumbers; ++b) gain -= step[a] * equations.matrix[a][b] * step[b];
  }
  return gain;
}

// Of the slopes of the picture at `view` by every number; `lengths` are the steps to find them by,
// those of shifts a guess that is made right here. To both sides: a difference to one side is off
// by the bend of the picture, and where turns and shifts nearly undo each other, that is most of
// what is left.
std::optional<NormalEquations> normal_equations_at(
    const std::function<Image(const Camera&)>& render,
    const AlignedView& view,
    const Image& photo,
    const Image& weight,
    Numbers& lengths) {
  std::array<Image, kNumbers> slopes;
  double by_turns = 0.0;  // how much a turn of as many pixels changes
  for (std::size_t k = 0; k < kNumbers; ++k) {
    Image& picture = slopes[k];
    double length = 0.0;
    for (int again = 0; again < kShiftTries; ++again) {
      length = lengths[k];
      picture = render(moved_by(view.camera, k, length));
      if (picture.data.empty()) return std::nullopt;
      const double change = squared_change(picture, view.render, photo, weight);
      if (k < 2) by_turns += 0.5 * change;
      if (k != 3 || change <= 0.0 || by_turns <= 0.0) break;
      // How far away things are says how far a shift moves the picture.
      const double factor = std::sqrt(by_turns / change);
      if (factor > 0.25 && factor < 4.0) break;
      for (std::size_t s = 3; s < kNumbers; ++s) lengths[s] *= std::clamp(factor, 1e-3, 1e3);
    }
    const Image behind = render(moved_by(view.camera, k, -length));
    if (behind.data.empty()) return std::nullopt;
    const auto scale = static_cast<float>(0.5 / length);
    for (std::size_t i = 0; i < behind.data.size(); ++i)
      picture.data[i] = scale * (picture.data[i] - behind.data[i]);
  }
  NormalEquations out;
  for_all_numbers(photo, weight, view.render.channels, [&](std::size_t i, double w, std::size_t k) {
    const double missing =
        static_cast<double>(photo.data[i]) - static_cast<double>(view.render.data[k]);
    Numbers slope;
    for (std::size_t a = 0; a < kNumbers; ++a) slope[a] = static_cast<double>(slopes[a].data[k]);
    for (std::size_t a = 0; a < kNumbers; ++a) {
      out.right[a] += w * slope[a] * missing;
      for (std::size_t b = 0; b < kNumbers; ++b) out.matrix[a][b] += w * slope[a] * slope[b];
    }
  });
  return out;
}

}  // namespace

std::optional<AlignedView> align_view(const std::function<Image(const Camera&)>& render,
                                      const Camera& start,
                                      const Image& photo,
                                      const Image& weight) {
  AlignedView best{start, render(start)};
  if (best.render.data.empty()) return std::nullopt;
  double error = squared_error(best.render, photo, weight);
  const double turn = step_turn(start);
  const double shift = turn * std::max(glm::length(start.center()), 1e-3);
  Numbers lengths{turn, turn, turn, shift, shift, shift};
  double damping = kFirstDamping;
  std::optional<NormalEquations> equations;  // at the best camera
  for (int tries = 0; tries < kMostSteps; ++tries) {
    if (!equations) equations = normal_equations_at(render, best, photo, weight, lengths);
    if (!equations) return std::nullopt;
    const Numbers step = solve(equations->matrix, equations->right, damping);
    if (!(expected_gain(*equations, step) > kLeastGain * error)) break;  // it has arrived
    Camera camera = moved_by(best.camera, step);
    Image picture = render(camera);
    if (picture.data.empty()) return std::nullopt;
    const double now = squared_error(picture, photo, weight);
    if (!(now < error)) {  // what is not finite either
      damping *= 10.0;
      continue;
    }
    damping *= 0.1;
    const bool last = error - now < kLeastGain * error;
    best = {std::move(camera), std::move(picture)};
    error = now;
    equations.reset();
    if (last) break;
  }
  return best;
}

}  // namespace raysplats
