// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <utility>

namespace raysplats {

/// Tells whether the pictures of a run come nearer to its photos. Views differ in what they can
/// reach, so a view is compared with itself.
class PsnrRise {
 public:
  /// A view, at the divisor of its resolution, was reported with this PSNR in decibels. One that
  /// begins with the greatest PSNR that is told (kMostPsnr) cannot rise and does not count.
  void note(std::size_t view, int divisor, double psnr);
  /// The most that a view has gained over its first report, in decibels; none before enough views
  /// returned to judge.
  std::optional<double> most() const;
  /// Whether enough views returned, and none of them rose.
  bool learned_nothing() const;

  static constexpr double kLeast = 0.1;  ///< decibels that a run has to gain

 private:
  std::map<std::pair<std::size_t, int>, double> first_;  // by view and divisor, as reported
  std::optional<double> most_;
  int seen_again_ = 0;
};

}  // namespace raysplats
