// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

/// What reader and writer of SOG share. Its layout: PlayCanvas, splat-transform, version 2; the
/// reader knows the first version too, which PlayCanvas's sogs wrote.
namespace raysplats::io {

constexpr int kSogVersion = 2;
constexpr int kSogMostDegree = 3;
constexpr std::size_t kSogLevels = 256;         // of a codebook
constexpr std::size_t kSogMostEntries = 65536;  // of the palette of harmonics
constexpr std::size_t kSogEntriesPerRow = 64;   // of its texture
/// Gaussians that a byte on the disk may stand for; real ones take 8 to 16 bytes.
constexpr std::uint64_t kSogMostPerByte = 8;
constexpr int kSogRotation = 252;  // alpha of a rotation whose w is the largest

}  // namespace raysplats::io
