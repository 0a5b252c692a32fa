// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raysplats::view {

/// Decides when pictures may be drawn so that they take a share of the time: what has not been used
/// is kept, up to half a second, and what was drawn beyond it is waited off.
class TimeShare {
 public:
  /// `share` of all time, 0 to 1.
  void set_share(double share) { share_ = share; }
  double share() const { return share_; }
  /// `seconds` have passed, work and pictures together. Up to 2 s after somebody moved pictures may
  /// take half of them, unless the share is 0.
  void pass(double seconds, double since_motion);
  /// A picture took so long.
  void spend(double seconds) { credit_ -= seconds; }
  /// Nobody looks: what was not used is lost, and what was used too much forgiven.
  void reset() { credit_ = 0; }
  bool free() const { return credit_ > 0; }

 private:
  double share_ = 0.1;
  double credit_ = 0;
  bool moved_ = false;
};

}  // namespace raysplats::view
