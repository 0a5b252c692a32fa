// SPDX-License-Identifier: Apache-2.0
// One file of a COLMAP model: the first byte says which, the two others are small and sound.
#include <array>
#include <string_view>

#include "fuzz/fuzz_target.hpp"
#include "io/dataset/colmap_model.hpp"

namespace raysplats::fuzz {
namespace {

constexpr std::array<const char*, 3> kStems{"cameras", "images", "points3D"};
constexpr std::array<std::string_view, 3> kSound{
    "1 PINHOLE 8 6 7 7 4 3\n", "1 1 0 0 0 0 0 0 1 a.png\n\n", "1 0 0 1 255 128 0 0.5 1 0\n"};

void parse(std::span<const std::uint8_t> input) {
  const std::size_t choice = take_choice(input, 2 * kStems.size());
  const bool binary = choice < kStems.size();
  for (std::size_t i = 0; i < kStems.size(); ++i) {
    const std::string stem = kStems[i];
    std::error_code error;
    std::filesystem::remove(scratch().path() / (stem + ".bin"), error);
    if (i == choice % kStems.size()) {
      scratch().write(stem + (binary ? ".bin" : ".txt"), input);
    } else {
      scratch().write(stem + ".txt",
                      {reinterpret_cast<const std::uint8_t*>(kSound[i].data()), kSound[i].size()});
    }
  }
  io::read_colmap_model(scratch().path());
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
