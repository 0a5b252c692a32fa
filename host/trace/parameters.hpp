// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "device/buffer.hpp"
#include "device/kernel.hpp"

namespace raysplats {

enum class ParameterGroup { kMeans, kQuaternions, kScales, kOpacities, kSh };
constexpr std::array<ParameterGroup, 5> kParameterGroups{
    ParameterGroup::kMeans, ParameterGroup::kQuaternions, ParameterGroup::kScales,
    ParameterGroup::kOpacities, ParameterGroup::kSh};

/// "means", "quaternions", "scales", "opacities" or "sh", as in checkpoints.
const char* group_name(ParameterGroup group);
/// Floats of one Gaussian.
std::size_t group_width(ParameterGroup group, int sh_degree);

/// A number for every parameter of some Gaussians (the parameters themselves, their gradients, the
/// moments of an optimiser): one flat buffer per group, Gaussian-major as in Gaussians.
struct Parameters {
  Buffer<float> means;        ///< 3 N
  Buffer<float> quaternions;  ///< 4 N
  Buffer<float> scales;       ///< 3 N, before the activation
  Buffer<float> opacities;    ///< N
  Buffer<float> sh;           ///< N x coefficients x 3

  Buffer<float>& operator[](ParameterGroup group);
  const Buffer<float>& operator[](ParameterGroup group) const;

  /// RS_GAUSSIAN_ARGUMENTS of cl/trace/arguments.h.
  auto arguments() const { return argument_pack(means, quaternions, scales, opacities, sh); }

  /// Makes room for `count` Gaussians; what is in a buffer is lost where it has to grow. `what` is
  /// told where memory runs out ("gradients").
  void ensure(Context& context, std::size_t count, int sh_degree, const std::string& what);
};

/// visit(group, of.[group]...) for every group in turn.
template <class Visit, class... Of>
void for_each_group(Visit&& visit, Of&... of) {
  for (const ParameterGroup group : kParameterGroups) visit(group, of[group]...);
}

}  // namespace raysplats
