// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/pose_refinement.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <limits>

#include "raysplats/error.hpp"
#include "train/capture_geometry.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

constexpr double kExtent = 4.0;

glm::dvec3 random_vector(CounterRng& rng) { return {rng.normal(), rng.normal(), rng.normal()}; }

std::vector<Camera> ring(std::size_t count) {
  CounterRng rng(3, 0);
  std::vector<Camera> cameras;
  for (std::size_t i = 0; i < count; ++i) {
    const glm::dvec3 eye = kExtent * glm::normalize(random_vector(rng));
    cameras.push_back(look_at(eye, 0.3 * random_vector(rng), {0, 0, 1}, 64, 48, 60.0));
  }
  return cameras;
}

PoseRefinement refinement(const std::vector<Camera>& cameras) {
  return {cameras, kExtent, subject_distances(cameras, {}, kExtent)};
}

double angle_between(const Camera& a, const Camera& b) {
  const glm::dmat3 turn = a.rotation * glm::transpose(b.rotation);
  return std::acos(std::clamp(0.5 * (turn[0][0] + turn[1][1] + turn[2][2] - 1.0), -1.0, 1.0));
}

/// Gradient of the squared distance from a pose, in the coordinates of PoseGradient.
PoseGradient towards(const Camera& now, const Camera& target) {
  PoseGradient out;
  const glm::dvec3 apart = now.center() - target.center();
  // now = exp([w]) target: the turn that is too much.
  const glm::dquat turn = glm::quat_cast(now.rotation * glm::transpose(target.rotation));
  for (int k = 0; k < 3; ++k) {
    out.center[static_cast<std::size_t>(k)] = 2.0 * apart[k] / (kExtent * kExtent);
    out.rotation[static_cast<std::size_t>(k)] = 4.0 *
                                                (k == 0   ? turn.x
                                                 : k == 1 ? turn.y
                                                          : turn.z) *
                                                (turn.w < 0 ? -1.0 : 1.0);
  }
  return out;
}

/// The poses of a state after a step along no gradient.
PoseRefinement settled(const std::vector<Camera>& cameras, const PoseRefinement::State& state) {
  PoseRefinement out = refinement(cameras);
  out.restore(state);
  out.step(0, {}, 1e-3);
  return out;
}

}  // namespace

TEST_CASE("poses follow their gradients to where the photos were taken") {
  const std::vector<Camera> start = ring(24);
  CounterRng rng(5, 0);
  PoseRefinement::State state = refinement(start).state();
  for (std::size_t i = 0; i < state.deltas.size(); ++i) {
    const double size = i % PoseRefinement::kNumbers < 3 ? 0.005 : 0.02;
    state.deltas[i] = static_cast<float>(size * rng.normal());
  }
  // Without what they have in common, which nobody can know.
  const std::vector<Camera> truth = settled(start, state).cameras();
  PoseRefinement poses = refinement(start);
  CHECK(angle_between(poses.camera(3), start[3]) < 1e-7);
  CHECK(glm::distance(poses.camera(3).center(), start[3].center()) < 1e-12);
  for (int pass = 0; pass < 200; ++pass) {
    const double rate = 2e-3 * std::pow(0.01, pass / 200.0);
    for (std::size_t view = 0; view < truth.size(); ++view)
      poses.step(view, towards(poses.camera(view), truth[view]), rate);
  }
  double angle = 0.0, distance = 0.0, angle_before = 0.0, distance_before = 0.0;
  for (std::size_t view = 0; view < truth.size(); ++view) {
    angle = std::max(angle, angle_between(poses.camera(view), truth[view]));
    distance = std::max(distance, glm::distance(poses.camera(view).center(), truth[view].center()));
    angle_before = std::max(angle_before, angle_between(start[view], truth[view]));
    distance_before =
        std::max(distance_before, glm::distance(start[view].center(), truth[view].center()));
  }
  MESSAGE("turn ", angle, " of ", angle_before, ", shift ", distance, " of ", distance_before);
  CHECK(angle < 0.05 * angle_before);
  CHECK(distance < 0.05 * distance_before);
}

TEST_CASE("a motion that all cameras have in common is taken off, and nothing else") {
  const std::vector<Camera> start = ring(40);
  const glm::dvec3 turn(0.001, -0.002, 0.0015), shift(0.02, 0.01, -0.03);
  PoseRefinement::State common = refinement(start).state();
  PoseRefinement::State own = common;
  for (std::size_t view = 0; view < start.size(); ++view) {
    const glm::dvec3 turned = -(start[view].rotation * turn);
    const glm::dvec3 moved =
        glm::cross(turn, start[view].center()) + shift + 0.002 * start[view].center();
    for (int k = 0; k < 3; ++k) {
      const std::size_t i = PoseRefinement::kNumbers * view + static_cast<std::size_t>(k);
      common.deltas[i] = static_cast<float>(turned[k]);
      common.deltas[i + 3] = static_cast<float>(moved[k]);
    }
  }
  const PoseRefinement still = settled(start, common);
  for (const float delta : still.state().deltas) CHECK(std::abs(delta) < 1e-6f);
  // One camera's own motion stays, but for its share of the mean.
  own.deltas[6 * 7 + 1] = 0.01f;
  own.deltas[6 * 7 + 5] = 0.1f;
  const PoseRefinement kept = settled(start, own);
  CHECK(kept.state().deltas[6 * 7 + 1] > 0.009f);
  CHECK(kept.state().deltas[6 * 7 + 5] > 0.09f);
  for (std::size_t i = 0; i < 6; ++i) CHECK(std::abs(kept.state().deltas[6 * 8 + i]) < 0.01f);
}

TEST_CASE("views that are not trained stay, and do not hide what the trained ones have in common") {
  const std::vector<Camera> start = ring(24);
  const std::vector<std::size_t> apart{3, 9, 20};
  PoseRefinement poses(start, kExtent, subject_distances(start, {}, kExtent), 0.0, apart);
  // All photos ask for the same motion of the scene, a turn and a shift.
  const glm::dvec3 turn(0.02, -0.04, 0.03), shift(0.2, 0.1, -0.3);
  const auto target = [&](const Camera& camera) {
    return moved(camera, -(camera.rotation * turn), glm::cross(turn, camera.center()) + shift);
  };
  CounterRng rng(7, 0);
  for (int pass = 0; pass < 20; ++pass) {
    for (std::size_t view = 0; view < start.size(); ++view) {
      if (std::binary_search(apart.begin(), apart.end(), view)) continue;
      PoseGradient gradient = towards(poses.camera(view), target(start[view]));
      gradient.rotation[0] += 0.1 * rng.normal();
      poses.step(view, gradient, 2e-3);
    }
  }
  const std::vector<float>& deltas = poses.state().deltas;
  double most = 0.0;
  glm::dvec3 mean_shift(0.0), torque(0.0);
  for (std::size_t view = 0; view < start.size(); ++view) {
    const float* d = &deltas[PoseRefinement::kNumbers * view];
    const bool trained = !std::binary_search(apart.begin(), apart.end(), view);
    for (std::size_t k = 0; k < PoseRefinement::kNumbers; ++k) {
      if (!trained) CHECK(d[k] == 0.0f);
      most = std::max(most, std::abs(static_cast<double>(d[k])));
    }
    if (!trained) continue;
    const glm::dvec3 moved_by(d[3], d[4], d[5]), turned(d[0], d[1], d[2]);
    mean_shift += moved_by / 21.0;
    // Least squares of a common turn leave none of it: W of what is left is 0.
    torque += glm::cross(start[view].center(), moved_by) / (kExtent * kExtent) -
              glm::transpose(start[view].rotation) * turned;
  }
  CHECK(most > 1e-3);
  CHECK(glm::length(mean_shift) < 1e-5);
  CHECK(glm::length(torque) < 1e-5);
}

TEST_CASE("a camera far from all others does not hide the motion that they have in common") {
  std::vector<Camera> start = ring(40);
  start.push_back(look_at({300 * kExtent, 0, 0}, {0, 0, 0}, {0, 0, 1}, 64, 48, 60.0));
  const glm::dvec3 turn(0.001, -0.002, 0.0015);
  PoseRefinement::State state = refinement(start).state();
  for (std::size_t view = 0; view + 1 < start.size(); ++view) {
    const glm::dvec3 turned = -(start[view].rotation * turn);
    const glm::dvec3 moved = glm::cross(turn, start[view].center()) + 0.002 * start[view].center();
    for (int k = 0; k < 3; ++k) {
      const std::size_t i = PoseRefinement::kNumbers * view + static_cast<std::size_t>(k);
      state.deltas[i] = static_cast<float>(turned[k]);
      state.deltas[i + 3] = static_cast<float>(moved[k]);
    }
  }
  const PoseRefinement after = settled(start, state);
  for (std::size_t i = 0; i < PoseRefinement::kNumbers * 40; ++i)
    CHECK(std::abs(after.state().deltas[i]) < 1e-6f);
}

TEST_CASE("a prior holds poses back as far as it outweighs what photos tell") {
  const std::vector<Camera> start = ring(24);
  PoseRefinement::State state = refinement(start).state();
  for (std::size_t i = 0; i < state.deltas.size(); i += 7) state.deltas[i] = 0.004f;
  const std::vector<Camera> truth = settled(start, state).cameras();
  // The loss is the squared distance, whose slope is twice it: an equal prior meets it half way.
  PoseRefinement poses(start, kExtent, subject_distances(start, {}, kExtent), 2.0);
  for (int pass = 0; pass < 300; ++pass) {
    const double rate = 1e-3 * std::pow(0.003, pass / 300.0);
    for (std::size_t view = 0; view < truth.size(); ++view)
      poses.step(view, towards(poses.camera(view), truth[view]), rate);
  }
  for (std::size_t view = 0; view < truth.size(); ++view) {
    CAPTURE(view);
    const double apart = angle_between(start[view], truth[view]);
    const double moved = glm::distance(start[view].center(), truth[view].center());
    CHECK(std::abs(angle_between(poses.camera(view), start[view]) - 0.5 * apart) < 1e-4);
    CHECK(std::abs(glm::distance(poses.camera(view).center(), start[view].center()) - 0.5 * moved) <
          1e-4 * kExtent);
  }
}

TEST_CASE("what a camera sees lies at its points, else where all look, else at the extent") {
  const std::vector<Camera> cameras = ring(20);
  for (const double distance : subject_distances(cameras, {}, kExtent))
    CHECK(distance == doctest::Approx(kExtent).epsilon(0.2));
  PointCloud points;
  CounterRng rng(1, 0);
  for (int i = 0; i < 9000; ++i) {
    const glm::dvec3 p = cameras[0].center() + glm::transpose(cameras[0].rotation) *
                                                   glm::dvec3(0, 0, 7.0 + 0.1 * rng.normal());
    for (int k = 0; k < 3; ++k) points.positions.push_back(static_cast<float>(p[k]));
  }
  CHECK(subject_distances(cameras, points, kExtent)[0] == doctest::Approx(7.0).epsilon(0.01));
  // Cameras that stand near to each other see far; never less than where they stand.
  const std::vector<Camera> near{cameras[0], cameras[0], cameras[0]};
  CHECK(subject_length(near, points, 0.01) == doctest::Approx(7.0).epsilon(0.01));
  CHECK(subject_length(near, points, 30.0) == 30.0);
  CHECK(subject_length(cameras, {}, kExtent) == doctest::Approx(kExtent).epsilon(0.2));
  CHECK(subject_distances(std::vector<Camera>{cameras[0]}, {}, kExtent)[0] == kExtent);
}

TEST_CASE("poses go on from their state to the bit, and refuse what is no gradient or no state") {
  const std::vector<Camera> truth = ring(6);
  CounterRng rng(9, 0);
  const auto random_gradient = [&] {
    PoseGradient out;
    for (std::size_t k = 0; k < 3; ++k) {
      out.center[k] = rng.normal();
      out.rotation[k] = rng.normal();
    }
    return out;
  };
  PoseRefinement poses = refinement(truth);
  for (int i = 0; i < 20; ++i) poses.step(rng.below(6), random_gradient(), 1e-3);
  PoseRefinement again = refinement(truth);
  again.restore(poses.state());
  const PoseGradient gradient = random_gradient();
  poses.step(2, gradient, 1e-3);
  again.step(2, gradient, 1e-3);
  CHECK(poses.state().deltas == again.state().deltas);
  CHECK(poses.state().second == again.state().second);

  const std::vector<float> before = poses.state().deltas;
  PoseGradient broken = gradient;
  broken.rotation[1] = std::numeric_limits<double>::quiet_NaN();
  poses.step(2, broken, 1e-3);
  CHECK(poses.state().deltas == before);
  PoseRefinement::State other = poses.state();
  other.steps.pop_back();
  CHECK_THROWS_AS(poses.restore(other), DataError);
}
