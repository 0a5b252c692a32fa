// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <string>

#include "program.hpp"
#include "raysplats/io.hpp"

/// A data set of five wide photos between black bars.
inline void write_barred_photos(const TemporaryFolder& folder) {
  constexpr int kWidth = 500, kHeight = 260, kBar = 40;
  std::string frames;
  for (int photo = 0; photo < 5; ++photo) {
    raysplats::Image image(kWidth, kHeight, 3);
    for (int y = kBar; y < kHeight - kBar; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        for (int c = 0; c < 3; ++c)
          image.at(x, y, c) = 0.3f + 0.002f * static_cast<float>((x + 5 * photo + 20 * c) % 300);
      }
    }
    const std::string name = fmt::format("{}.png", photo);
    raysplats::write_image(folder / name, image);
    frames += fmt::format(
        "{}{{\"file_path\": \"{}\", \"transform_matrix\": [[1, 0, 0, {}], [0, 1, 0, 0], "
        "[0, 0, 1, 4], [0, 0, 0, 1]]}}",
        photo > 0 ? ", " : "", name, 0.1 * photo);
  }
  write_file(folder / "transforms.json",
             fmt::format("{{\"camera_angle_x\": 0.8, \"frames\": [{}]}}", frames));
}
