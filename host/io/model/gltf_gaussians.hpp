// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/mat4x4.hpp>
#include <string>

/// Names of KHR_gaussian_splatting (KhronosGroup/glTF, extensions/2.0/Khronos), which reader and
/// writer share.
namespace raysplats::io {

constexpr const char* kSplattingExtension = "KHR_gaussian_splatting";
constexpr const char* kSplattingRotation = "KHR_gaussian_splatting:ROTATION";
constexpr const char* kSplattingScale = "KHR_gaussian_splatting:SCALE";
constexpr const char* kSplattingOpacity = "KHR_gaussian_splatting:OPACITY";
constexpr int kSplattingMaxDegree = 3;
/// Smallest scale that has a logarithm to go on with.
constexpr float kSplattingLeastScale = 1e-30f;

/// Coefficient n = 0 .. 2 * degree, from the lowest order on.
std::string splatting_harmonic(int degree, int n);

/// Half a turn about z, there and back: glTF has y up, captures have y down.
glm::dmat4 splatting_turn();

}  // namespace raysplats::io
