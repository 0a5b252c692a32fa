// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/pose_refinement.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <iterator>
#include <numeric>
#include <utility>

#include "raysplats/error.hpp"
#include "train/capture_geometry.hpp"

namespace raysplats {
namespace {

constexpr double kBeta1 = 0.9;
constexpr double kBeta2 = 0.999;
constexpr double kEpsilon = 1e-15;

glm::dvec3 turn_of(const std::vector<float>& deltas, std::size_t view) {
  const float* d = &deltas[PoseRefinement::kNumbers * view];
  return {d[0], d[1], d[2]};
}

glm::dvec3 shift_of(const std::vector<float>& deltas, std::size_t view) {
  const float* d = &deltas[PoseRefinement::kNumbers * view + 3];
  return {d[0], d[1], d[2]};
}

// All of so many views but those `apart`.
std::vector<std::size_t> trained_of(std::size_t views, std::span<const std::size_t> apart) {
  std::vector<std::size_t> all(views), out;
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::set_difference(all.begin(), all.end(), apart.begin(), apart.end(), std::back_inserter(out));
  return out;
}

// Those of `views` that are no stray cameras among them.
std::vector<std::size_t> usual_of(const std::vector<Camera>& cameras,
                                  const std::vector<std::size_t>& views) {
  std::vector<Camera> own;
  own.reserve(views.size());
  for (const std::size_t view : views) own.push_back(cameras[view]);
  std::vector<std::size_t> out;
  for (const std::size_t i : usual_cameras(own)) out.push_back(views[i]);
  return out;
}

}  // namespace

PoseRefinement::PoseRefinement(std::vector<Camera> cameras,
                               double extent,
                               std::vector<double> distances,
                               double prior,
                               std::span<const std::size_t> apart)
    : cameras_(std::move(cameras)),
      extent_(extent),
      distances_(std::move(distances)),
      prior_(prior),
      trained_(trained_of(cameras_.size(), apart)),
      usual_(usual_of(cameras_, trained_)) {
  const std::size_t numbers = kNumbers * cameras_.size();
  state_.deltas.resize(numbers);
  state_.first.resize(numbers);
  state_.second.resize(numbers);
  state_.steps.resize(cameras_.size());
}

Camera PoseRefinement::camera(std::size_t view) const {
  return moved(cameras_[view], turn_of(state_.deltas, view), shift_of(state_.deltas, view));
}

std::vector<Camera> PoseRefinement::cameras() const {
  std::vector<Camera> out;
  out.reserve(cameras_.size());
  for (std::size_t view = 0; view < cameras_.size(); ++view) out.push_back(camera(view));
  return out;
}

void PoseRefinement::step(std::size_t view, const PoseGradient& gradient, double rate) {
  glm::dvec3 by_turn(gradient.rotation[0], gradient.rotation[1], gradient.rotation[2]);
  glm::dvec3 by_center(gradient.center[0], gradient.center[1], gradient.center[2]);
  by_turn += prior_ * turn_of(state_.deltas, view);
  by_center += prior_ / (extent_ * extent_) * shift_of(state_.deltas, view);
  const glm::dmat3 back = turn_back(view);
  const glm::dvec3 around = extent_ * (by_center + glm::transpose(back) * by_turn);
  const std::array<double, kNumbers> slope{by_turn.x, by_turn.y, by_turn.z,
                                           around.x,  around.y,  around.z};
  if (!std::all_of(slope.begin(), slope.end(), [](double s) { return std::isfinite(s); })) return;
  const double steps = static_cast<double>(state_.steps[view] += 1.0f);
  std::array<glm::dvec3, 2> change{glm::dvec3(0.0), glm::dvec3(0.0)};
  for (std::size_t k = 0; k < kNumbers; ++k) {
    const std::size_t i = kNumbers * view + k;
    const double first = kBeta1 * state_.first[i] + (1.0 - kBeta1) * slope[k];
    const double second = kBeta2 * state_.second[i] + (1.0 - kBeta2) * slope[k] * slope[k];
    const double mean = first / (1.0 - std::pow(kBeta1, steps));
    const double square = second / (1.0 - std::pow(kBeta2, steps));
    const double unit = k < 3 ? 1.0 : extent_;
    state_.first[i] = static_cast<float>(first);
    state_.second[i] = static_cast<float>(second);
    change.at(k / 3)[static_cast<int>(k % 3)] =
        -rate * unit * mean / (std::sqrt(square) + kEpsilon);
  }
  const glm::dvec3 turn = change[0] + back * change[1];
  for (int k = 0; k < 3; ++k) {
    float* delta = &state_.deltas[kNumbers * view + static_cast<std::size_t>(k)];
    delta[0] = static_cast<float>(delta[0] + turn[k]);
    delta[3] = static_cast<float>(delta[3] + change[1][k]);
  }
  remove_common_motion();
}

glm::dmat3 PoseRefinement::turn_back(std::size_t view) const {
  // A point at (0, 0, D) before the camera moves by -R d with the centre; a turn by w moves it by
  // w x p = (w.y D, -w.x D, 0).
  const glm::dmat3 axes = glm::transpose(cameras_[view].rotation);  // columns: the camera's axes
  const double inverse = 1.0 / distances_[view];
  return glm::transpose(glm::dmat3(-inverse * axes[1], inverse * axes[0], glm::dvec3(0.0)));
}

void PoseRefinement::remove_common_motion() {
  const auto count = static_cast<double>(usual_.size());
  glm::dvec3 middle(0.0), shift(0.0);
  for (const std::size_t view : usual_) {
    middle += cameras_[view].center() / count;
    shift += shift_of(state_.deltas, view) / count;
  }
  // A turn by W of everything moves the centre at r by W x r and turns the camera by -R W about its
  // axes; a scale moves it along r. Shifts and turns count alike in units of the extent.
  glm::dmat3 sum(0.0);
  glm::dvec3 right(0.0);
  double along = 0.0, square = 0.0;
  for (const std::size_t view : usual_) {
    const glm::dvec3 r = (cameras_[view].center() - middle) / extent_;
    const glm::dvec3 d = (shift_of(state_.deltas, view) - shift) / extent_;
    sum += glm::dmat3(1.0 + glm::dot(r, r)) - glm::outerProduct(r, r);
    right +=
        glm::cross(r, d) - glm::transpose(cameras_[view].rotation) * turn_of(state_.deltas, view);
    along += glm::dot(r, d);
    square += glm::dot(r, r);
  }
  const glm::dvec3 turn = glm::inverse(sum) * right;
  const double scale = square > 0.0 ? along / square : 0.0;
  for (const std::size_t view : trained_) {
    const glm::dvec3 r = cameras_[view].center() - middle;
    const glm::dvec3 moved = shift + glm::cross(turn, r) + scale * r;
    const glm::dvec3 turned = cameras_[view].rotation * turn;
    for (int k = 0; k < 3; ++k) {
      float* delta = &state_.deltas[kNumbers * view + static_cast<std::size_t>(k)];
      delta[0] = static_cast<float>(delta[0] + turned[k]);
      delta[3] = static_cast<float>(delta[3] - moved[k]);
    }
  }
}

void PoseRefinement::restore(const State& state) {
  if (state.deltas.size() != state_.deltas.size() || state.first.size() != state_.first.size() ||
      state.second.size() != state_.second.size() || state.steps.size() != state_.steps.size()) {
    throw DataError("The poses of the checkpoint are not of as many photos as the data set has");
  }
  state_ = state;
}

}  // namespace raysplats
