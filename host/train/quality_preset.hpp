// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"

namespace raysplats {

/// How good a model has to be, for those who do not want to choose numbers.
enum class Quality { kPreview, kLow, kMedium, kHigh };

/// "preview", "low", "medium", "high", in the order of Quality.
const std::vector<std::string>& quality_names();
/// Throws UsageError for another name.
Quality parse_quality(const std::string& name);

/// What a quality means for a capture on a device. The number of Gaussians follows from both by the
/// rule of max-gaussians = 0.
struct QualityChoice {
  std::int64_t iterations = 0;
  int downscale = 1;  ///< by a whole number, so that reduced photos of a data set can be used
};

/// `dataset` at its full size. Iterations are passes over the training photos within limits, the
/// lower of which gives way to what few photos ask for (usual_length()); photos are reduced as the
/// median one of their longest sides asks for, which may be half as long on CPUs as elsewhere. Of a
/// strip the longest side is that of as many pixels in the shape 2:1.
QualityChoice choose_quality(Quality quality, const Dataset& dataset, DeviceType device);

/// By what the sizes of photos are divided where nobody says. The longer side of the usual photo of
/// `dataset`, as above and at its full size, is reduced to 1600 pixels, as in 3DGS; of a run of so
/// many `seconds` to fewer, so that it sees each photo more than once. 1 where that is little less.
double fitting_downscale(const Dataset& dataset,
                         DeviceType device,
                         std::optional<double> seconds = std::nullopt);

}  // namespace raysplats
