// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <ostream>

#include "bvh/lbvh.hpp"

namespace raysplats {

inline std::ostream& operator<<(std::ostream& out, const TreeForm& form) {
  return out << form.lanes << (form.trail ? " lanes by a trail" : " lanes");
}

namespace test {

/// Every form that trees have, those of other devices too.
constexpr std::array<TreeForm, 4> kTreeForms{{{4, false}, {8, false}, {16, false}, {4, true}}};
/// The narrowest, the widest and that of GPUs.
constexpr std::array<TreeForm, 3> kUnlikeTreeForms{{{4, false}, {16, false}, {4, true}}};

}  // namespace test
}  // namespace raysplats
