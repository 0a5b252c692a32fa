// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <glm/mat4x4.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

/// What an SPZ says of its axes: the record SPZ_ADOBE_coordinate_system (nianticlabs/spz,
/// extensions/cc/coordinate-system-adobe.cc), whose number is one of CoordinateSystem's
/// (include/spz/splat-types.h).
namespace raysplats::io {

/// Right, up, back: what SPZ's specification wants.
constexpr std::uint32_t kSpzRub = 4;
/// Right, down, front: those of the PLY of a capture.
constexpr std::uint32_t kSpzRdf = 6;

/// The axes that the first such record among those of all extensions names, 1 to 16; nothing where
/// there is none or it leaves them open. Records end with the first that does not fit, as in
/// Niantic's own reader. Throws DataError for a number that stands for no axes.
std::optional<std::uint32_t> declared_spz_axes(std::span<const std::byte> records,
                                               const std::filesystem::path& path);

/// The record that names these axes.
std::vector<std::byte> spz_axes_record(std::uint32_t axes);

/// What x, y and z are, as in "x right, y up, z back"; of 1 to 16.
std::string spz_axes_name(std::uint32_t axes);

/// From these axes, 1 to 16, to those of the PLY: a turn by right angles, with a reflection where
/// they are left-handed.
glm::dmat4 spz_axes_turn(std::uint32_t axes);

}  // namespace raysplats::io
