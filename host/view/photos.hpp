// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "raysplats/dataset.hpp"

namespace raysplats::view {

/// The photos of a data set as a page sees them: JPEG, transparent parts over a background, at most
/// kPhotoSide pixels a side. For one thread.
constexpr int kPhotoSide = 1280;
class Photos {
 public:
  Photos(std::vector<View> views, const std::array<float, 3>& background);

  /// The file of a photo, of the views' number; nothing beyond. The files that were asked for last
  /// stay in memory. Throws DataError where the photo cannot be read.
  std::optional<std::string> jpeg(std::size_t index);

 private:
  std::vector<View> views_;
  std::array<float, 3> background_;
  std::deque<std::pair<std::size_t, std::string>> kept_;  // the newest first
};

}  // namespace raysplats::view
