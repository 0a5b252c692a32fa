// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "raysplats/camera.hpp"

namespace raysplats {

/// The longer side, at most, of the pictures in which a model is compared with its photos: what is
/// wrong with a pose, or moves, is seen in small ones as well, and what a model lacks of a close-up
/// is not, for that is to be learned.
constexpr int kComparedSide = 96;
/// The camera that takes such a picture.
Camera compared_camera(const Camera& full);

/// How near a model comes to a training photo, and where that was taken.
struct PlacedPhoto {
  double psnr = 0;                      ///< dB
  glm::dvec3 center{0.0};               ///< of the camera
  std::optional<glm::dvec3> direction;  ///< in which it looks, of length 1; none of panoramas
  double contrast = 0;                  ///< dB of the variance of its colours; 0 where not known
};

/// The photos from the nearest places to one, no farther away than `farthest`, that look the same
/// way (less than `degrees` apart; panoramas look all ways): positions, the nearest first, at most
/// `count`. O(N).
std::vector<std::size_t> photos_beside(std::span<const PlacedPhoto> photos,
                                       std::size_t photo,
                                       double degrees,
                                       std::size_t count,
                                       double farthest);

/// Photos that contradict others from beside them, where these are more than a tenth of all:
/// positions, ascending. Of the six nearest that look the same way (less than 30 degrees apart, no
/// farther away than the photos' median distance from their middle) two or more have a PSNR that is
/// 8 dB better, and 6 dB where the contrast of both is added: a dark photo is nearer to anything.
/// A capture has two parts then that do not fit, as when a reconstruction takes one side of an
/// object for another. Of a dozen sound captures and thirty rendered ones 0.05 of the photos or
/// fewer are such. None of fewer than 12 photos, of which each shows what no other does. O(N^2).
std::vector<std::size_t> contradicted_photos(std::span<const PlacedPhoto> photos);

/// Photos that a model is better without: positions, ascending. Those of which four of the six
/// beside them are 8 dB better, as of a wrong pose or behind a finger. And where
/// contradicted_photos() finds some, more than 0.03 of them once the former are gone, one side of a
/// fold: these too, and what is joined to them by photos beside each other (less than 45 degrees
/// apart) whose PSNR is on the lower side of all (of two classes with the least variance within
/// them, Otsu 1979). None where all these would be more than 0.6 of the photos. O(N^2).
std::vector<std::size_t> photos_to_leave_out(std::span<const PlacedPhoto> photos);

}  // namespace raysplats
