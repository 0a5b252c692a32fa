// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "raysplats/gaussians.hpp"

/// The packed arrays of SPZ (nianticlabs/spz, src/cc/load-spz.cc and splat-types.h describe them),
/// without the compression around them.
namespace raysplats::io {

constexpr std::uint32_t kSpzMagic = 0x5053474e;  // "NGSP"
constexpr int kSpzLastVersion = 4;
/// Bytes that one of gzip's can stand for (zlib's "deflate_technical" note); arrays of which zstd
/// would make less hold no model.
constexpr std::uint64_t kSpzMostShrinking = 1032;

/// A byte of colour holds this share of its number above and below 1/2.
constexpr double kSpzColorScale = 0.15;

/// What the header of every version says.
struct SpzHeader {
  std::uint32_t version = 3;
  std::uint32_t points = 0;
  std::uint8_t sh_degree = 0;
  std::uint8_t fractional_bits = 12;  ///< of positions
  std::uint8_t flags = 0;
};
constexpr std::uint8_t kSpzExtensions = 2;  ///< flag: records of extensions follow

/// Positions, alphas, colours, scales, rotations, SH.
constexpr std::size_t kSpzArrays = 6;
using SpzSizes = std::array<std::uint64_t, kSpzArrays>;

/// Throws DataError for what no file of `file_bytes` bytes can be.
void check_spz_header(const SpzHeader& header,
                      std::uint64_t file_bytes,
                      const std::filesystem::path& path);
/// Bytes of the arrays.
SpzSizes spz_sizes(const SpzHeader& header);
/// Arrays of exactly these sizes to Gaussians. Throws DataError for numbers that are not finite.
Gaussians unpack_spz(const SpzHeader& header,
                     const std::array<std::span<const std::byte>, kSpzArrays>& arrays,
                     const std::filesystem::path& path);

/// Bits behind the point of the positions: 12, as Niantic writes, more (24 at most) where steps of
/// 1/4096 are no quarter of the median Gaussian, and as many as there is room for.
int spz_fractional_bits(const Gaussians& model);

/// Arrays of version 3 and later; fills in the header. Warns where steps are larger than the median
/// Gaussian, and where Gaussians are smaller than the least scale.
std::array<std::vector<std::byte>, kSpzArrays> pack_spz(const Gaussians& model,
                                                        SpzHeader& header,
                                                        const std::filesystem::path& path);

}  // namespace raysplats::io
