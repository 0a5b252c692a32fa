// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "raysplats/camera.hpp"

namespace raysplats {

/// Where far more photos were taken than elsewhere, as where a video stands still.
struct CrowdedPlace {
  std::vector<std::size_t> photos;  ///< positions, ascending
  double distance = 0;              ///< to what the first one sees
};

struct CrowdedPlaces {
  std::vector<CrowdedPlace> places;
  std::size_t most = 0;  ///< photos that a place is worth; each of these has more
};

/// Whether two photos are from one place: they stand no farther apart than a hundredth of the
/// `distance` to what they see, and look the same way to 3 degrees; panoramas look all ways.
bool from_one_place(const Camera& a, const Camera& b, double distance);

/// `distances`: to what photos see (subject_distances()); that of the first photo of a place
/// decides. A place is worth four times as many photos as the median place has, so that captures
/// whose places all have many have none that is crowded. O(photos x places).
CrowdedPlaces crowded_places(std::span<const Camera> cameras, std::span<const double> distances);

}  // namespace raysplats
