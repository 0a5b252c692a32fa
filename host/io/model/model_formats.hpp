// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "raysplats/gaussians.hpp"
#include "raysplats/io.hpp"

/// Formats of Gaussians other than 3DGS PLY; read_model() and write_model() choose among them. All
/// readers throw DataError, one sentence with the path, for whatever is malformed, truncated or not
/// finite (but for Gaussians that are to be dropped), and allocate nothing that the file's size
/// does not bear out, beyond that of kAlwaysHeld Gaussians. Writers are atomic.
namespace raysplats::io {

/// Gaussians that any file may hold, however small: equal ones pack to next to nothing.
constexpr std::uint64_t kAlwaysHeld = std::uint64_t{1} << 18;

/// The records of 32 bytes of antimatter15/splat (convert.py): position and scale as floats, colour
/// and opacity as four bytes, rotation as four bytes, real part first.
Gaussians read_splat(const std::filesystem::path& path, bool drop_nonfinite = false);
/// Most important (largest times most opaque) first, as streams want them. SH is left out.
void write_splat(const std::filesystem::path& path, const Gaussians& model);

/// Niantic's SPZ, versions 1 to 4 (nianticlabs/spz), SH to degree 4. It is turned to the axes of
/// the PLY from those that it declares, from the assumed ones where it declares none; a line says
/// which.
constexpr float kSpzLeastLogScale = -10.0f;
constexpr float kSpzMostLogScale = 5.9375f;
Gaussians read_spz(const std::filesystem::path& path, SpzAxes assumed);
/// Version 3 or 4, which declares its axes. Positions keep 12 bits behind the point, fewer where
/// they are beyond +-2048. Throws DataError for positions beyond +-8388607.
void write_spz(const std::filesystem::path& path,
               const Gaussians& model,
               int version,
               SpzAxes axes);

/// write_ply() without its look at the numbers: what a run that diverged has learnt is kept, and is
/// refused when it is read. Throws UsageError where the arrays do not fit each other.
void write_ply_as_it_is(const std::filesystem::path& path,
                        const Gaussians& model,
                        const std::optional<TraceOptions>& trace,
                        const std::array<double, 3>& origin);

/// glTF 2.0, JSON or GLB, with KHR_gaussian_splatting (Khronos, release candidate of 2026): all
/// Gaussians of its scene, turned from y up to the y down of captures.
Gaussians read_gltf_gaussians(const std::filesystem::path& path, bool drop_nonfinite = false);
/// Whether a glTF file holds Gaussians; it may hold meshes too. Throws as read_gltf().
bool has_gltf_gaussians(const std::filesystem::path& path);
/// GLB with floats: nothing is lost up to SH degree 3 but in opacities within 1e-7 of 0 or 1 and
/// scales beyond 1e-30 to 2.4e17; SH above is left out. Throws DataError for more than the 4 GiB
/// that a GLB can have.
void write_glb(const std::filesystem::path& path, const Gaussians& model);

/// PlayCanvas' compressed PLY: chunks of 256 Gaussians in 16 bytes each, and SH in bytes.
Gaussians read_compressed_ply(const std::filesystem::path& path);
/// Along the Morton curve, so that chunks are small. SH above degree 3 is left out.
void write_compressed_ply(const std::filesystem::path& path, const Gaussians& model);

/// PlayCanvas' SOG, version 2: a zip archive of meta.json and lossless WebP textures, or the
/// meta.json of an unpacked one.
Gaussians read_sog(const std::filesystem::path& path);
/// A zip archive, along the Morton curve. SH above degree 3 is left out; what is above degree 0 is
/// shared by a palette of at most 65536 entries. Throws DataError for more than 268 million.
void write_sog(const std::filesystem::path& path, const Gaussians& model);

}  // namespace raysplats::io
