// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/image.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// Axes of SPZ files: most hold those of the PLY that they were made from, the specification wants
/// x right, y up, z back. Files since 2026 may declare theirs, and version 4 as written here does.
enum class SpzAxes { kPly, kRub };

/// How files of models other than PLY are read and written.
struct ModelEncoding {
  /// Of SPZ files that are written, and of those read that declare none.
  SpzAxes spz_axes = SpzAxes::kPly;
  int spz_version = 3;  ///< to write: 3 or 4
  /// Whether Gaussians with numbers that are not finite are left out of a 3DGS PLY, .splat or glTF,
  /// with a warning, or the file is refused. Other formats hold only finite ones.
  bool drop_nonfinite = false;
};

/// Reads Gaussians from a 3DGS PLY, PlayCanvas' compressed PLY and SOG, .splat, SPZ (1 to 4) or
/// glTF with KHR_gaussian_splatting, recognised by their first bytes, .splat by its name; of a SOG
/// that is unpacked its folder or its meta.json. glTF is turned to the y down of captures. Throws
/// DataError for anything malformed, truncated, oversized or, unless `encoding` drops them, with
/// numbers that are not finite.
Gaussians read_model(const std::filesystem::path& path, const ModelEncoding& encoding = {});

/// Writes atomically what the name's extension says: .ply, .compressed.ply, .splat, .spz, .sog or
/// .glb. `trace` and `origin` as for write_ply(); other formats do not keep them. Throws UsageError
/// for other names, DataError for numbers that are not finite and for what the format cannot hold.
void write_model(const std::filesystem::path& path,
                 const Gaussians& model,
                 const ModelEncoding& encoding = {},
                 const std::optional<TraceOptions>& trace = std::nullopt,
                 const std::array<double, 3>& origin = {});

/// Reads a 3DGS PLY (binary of both byte orders or ASCII; SH degree 0..4; the 3D filter of
/// Mip-Splatting goes into scales and opacities, infinite opacities and scales of 0 become the
/// nearest finite ones with a warning, further properties are ignored) or a compressed one of
/// PlayCanvas. Positions that are doubles which floats would blur, as in the coordinates of a map,
/// count from read_ply_origin(). Throws DataError with the byte offset for anything malformed,
/// truncated or oversized, and for numbers that are not finite unless those Gaussians of a 3DGS PLY
/// are to be left out.
Gaussians read_ply(const std::filesystem::path& path, bool drop_nonfinite = false);

/// Writes an Inria-style binary little-endian 3DGS PLY atomically (temporary file, sync, rename).
/// `trace` is how the model wants to be traced; the options of it that change the picture (order,
/// quantile, adaptive radius, near depth, transmittance, cap on hits, background) go into the
/// header as comments, which other programs skip; so does `origin`, from which positions count
/// (Dataset::origin), unless it is 0. Throws DataError for numbers that are not finite and for
/// quaternions that are no rotations, and UsageError where the arrays do not fit each other.
void write_ply(const std::filesystem::path& path,
               const Gaussians& model,
               const std::optional<TraceOptions>& trace = std::nullopt,
               const std::array<double, 3>& origin = {});

/// The options in the header of a PLY that write_ply() was given them for, the others as
/// TraceOptions has them; nothing for other files. Throws DataError for a value out of range.
std::optional<TraceOptions> read_ply_options(const std::filesystem::path& path);

/// From where the positions that read_ply() returns count: the origin in the header of a PLY, or of
/// one without that holds doubles far from 0 the origin that reading takes off; else 0. Throws
/// DataError for an origin that is no three numbers.
std::array<double, 3> read_ply_origin(const std::filesystem::path& path);

/// Reads PNG, JPEG, EXR, Radiance HDR, TIFF, WebP, BMP, GIF, TGA, HEIF or AVIF, of several pictures
/// the first, as float; 1 to 4 channels as in the file (grey stays 1 channel). Throws DataError for
/// a file that is none of these or damaged.
Image read_image(const std::filesystem::path& path);

/// What the numbers of a picture are: proportional to light, or display values (sRGB).
enum class ColorSpace { kUnknown, kLinear, kDisplay };

/// Writes .png, .jpg or .exr by the extension, atomically. 8-bit formats clamp to [0, 1] and round.
/// An EXR with channels beyond RGBA takes their names from `extra_channels` (for example "Z"),
/// and says in its attribute "oiio:ColorSpace" what `space` says. Throws UsageError for more pixels
/// a side than the format has (JPEG 65500, PNG 1000000), DataError when the file cannot be written.
void write_image(const std::filesystem::path& path,
                 const Image& image,
                 const std::vector<std::string>& extra_channels = {},
                 ColorSpace space = ColorSpace::kUnknown);

/// Cameras of a transforms.json (Blender or nerfstudio keys, file-level or per frame), OpenGL axes
/// on disk, or of a cameras.json as runs and other trainers of 3DGS write it; those of others have
/// neither lenses nor principal points.
std::vector<Camera> read_cameras(const std::filesystem::path& path);

/// Writes cameras as a nerfstudio transforms.json that read_cameras() reads back. Throws
/// UsageError, and writes nothing, for a camera without pixels or focal length, with a number that
/// is not finite, with a rotation that is none (Tracer), or of kPhotoLens without its lens.
void write_cameras(const std::filesystem::path& path, const std::vector<Camera>& cameras);

}  // namespace raysplats
