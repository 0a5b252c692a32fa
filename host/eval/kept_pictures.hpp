// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <memory>

#include "raysplats/dataset.hpp"

namespace raysplats {

/// Photos that renders are compared with again and again, as floats. The first ones that fit the
/// budget stay; the others are decoded whenever they are asked for (every view comes once per
/// evaluation, so replacing the oldest one would never find anything).
class KeptPictures {
 public:
  /// `budget` in bytes of the host.
  explicit KeptPictures(std::size_t budget) : budget_(budget) {}

  /// load_view_picture() of a view, by whose number it is known again. Throws as that does.
  std::shared_ptr<const ViewPicture> get(std::size_t number, const View& view);

  /// Bytes of the photos that stay.
  std::size_t kept_bytes() const { return kept_; }

 private:
  std::size_t budget_;
  std::size_t kept_ = 0;
  std::map<std::size_t, std::shared_ptr<const ViewPicture>> pictures_;
};

}  // namespace raysplats
