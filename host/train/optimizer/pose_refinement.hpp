// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <glm/mat3x3.hpp>
#include <span>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/pose_gradient.hpp"

namespace raysplats {

/// Poses of the training photos, trained beside the model where those of the data set are not exact
/// (phones, rigs, few matches): a turn about the camera's axes and a shift of its centre each, by
/// Adam (0.9, 0.999) on the gradients of the pictures. Moving all cameras and the scene together
/// changes no picture, so the motion that the trained cameras have in common (turn, shift and
/// scale, by least squares, without stray_cameras()) is taken off them after every step: the model
/// stays where the data set has it, and so do cameras that are not trained. On the host; equal
/// inputs give equal bits.
///
/// A camera that moves sideways and turns back to what it looked at changes its picture far less
/// than one that does either, so that gradients of centre and turn alone creep along that valley.
/// The steps are therefore taken in turns and in motions around what the camera sees.
class PoseRefinement {
 public:
  /// Numbers of a camera: the turn in radians (axes of the camera), then the shift in world units.
  static constexpr std::size_t kNumbers = 6;

  /// The whole state: kNumbers a photo each, steps one.
  struct State {
    std::vector<float> deltas, first, second, steps;
  };

  /// `extent` is the length that a turn by one radian is weighed against (scene_extent()),
  /// `distances` are those of what the cameras see (subject_distances()). `prior` is the weight of
  /// half the squared correction (radians and extents) beside a photo's loss: errors of poses are
  /// small and do not agree between photos. It holds the motions of which the photos tell next to
  /// nothing, where the model's own errors would decide, and leaves the others to the loss. Views
  /// `apart` (ascending) are not trained: they have no part in what is common and stay as they are.
  PoseRefinement(std::vector<Camera> cameras,
                 double extent,
                 std::vector<double> distances,
                 double prior = 0.0,
                 std::span<const std::size_t> apart = {});

  /// The camera of a photo where it is now, at the size of the data set.
  Camera camera(std::size_t view) const;
  std::vector<Camera> cameras() const;
  /// One step for a photo, `rate` in radians and extents. A gradient that is not finite changes
  /// nothing.
  void step(std::size_t view, const PoseGradient& gradient, double rate);

  const State& state() const { return state_; }
  /// Throws DataError when it is not of as many photos.
  void restore(const State& state);

 private:
  /// The turn by which a camera that has moved by d looks at what it saw: a matrix times d.
  glm::dmat3 turn_back(std::size_t view) const;
  void remove_common_motion();

  std::vector<Camera> cameras_;
  double extent_;
  std::vector<double> distances_;
  double prior_;
  std::vector<std::size_t> trained_;
  // Tell what motion these have in common: the distance of stray cameras would outweigh it.
  std::vector<std::size_t> usual_;
  State state_;
};

}  // namespace raysplats
