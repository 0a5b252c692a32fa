// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "device/context.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// One quantity of a small scene against the double-precision reference.
struct SelfTestCheck {
  std::string name;  ///< "tiles: image, mean difference"
  double error = 0;
  double limit = 0;          ///< of a device that computes as it should
  std::string failure = {};  ///< what was thrown instead of a result

  /// Not for an error that is no number.
  bool passed() const { return error <= limit; }
};

/// Traces a small scene forward and backward, by tiles and through the tree, and compares pictures
/// (absolute differences of colours from 0 to 1) and gradients (relative, per group of parameters)
/// with host/reference. Takes seconds, most of them for compiling. With `keep_failures` a way that
/// the device or a lack of memory makes fail ends in a check that has not passed.
std::vector<SelfTestCheck> run_self_test(Context& context,
                                         TraceOptions options,
                                         bool keep_failures = false);

}  // namespace raysplats
