// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>

namespace raysplats::io {

/// Most frames a second: what stays for less than 2/100 s browsers show for 1/10 s.
constexpr double kMostGifFps = 50.0;
/// Fewest: one frame stays for 65535/100 s at most.
constexpr double kLeastGifFps = 100.0 / UINT16_MAX;

/// Says how long each frame of a GIF stays, so that frame k begins at the hundredth of a second
/// nearest to k / fps: encoders have one length for all. Throws DataError, about `name`, when the
/// file ends before `frames` frames are whole: encoders do not notice a full disk.
void set_gif_delays(const std::filesystem::path& path,
                    const std::filesystem::path& name,
                    std::size_t frames,
                    double fps);

}  // namespace raysplats::io
