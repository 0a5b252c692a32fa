// SPDX-License-Identifier: Apache-2.0
// A camera path, as the first byte says: keyframes in TOML or JSON of nerfstudio, alone, at another
// speed, and in nerfstudio's scaled world, whose transform the input is as well.
#include <array>

#include "fuzz/fuzz_target.hpp"
#include "io/scene/camera_path_file.hpp"
#include "raysplats/io.hpp"

namespace raysplats::fuzz {
namespace {

constexpr std::array<const char*, 4> kNames{"path.toml", "path.json", "path.json", "path.json"};

void parse(std::span<const std::uint8_t> input) {
  const std::size_t choice = take_choice(input, kNames.size());
  const std::filesystem::path path = scratch().write(kNames[choice], input);
  PathOptions options;
  // The length is the file's business only within limits that keep a run short.
  options.seconds = 0.5;
  options.fps = 24.0;
  options.constant_speed = choice == 2;
  if (choice == 3) options.transform = path;
  const CameraPathFile file = read_camera_path(path, options);
  write_cameras(scratch().path() / "copy.json", file.cameras);
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
