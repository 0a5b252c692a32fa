// SPDX-License-Identifier: Apache-2.0
// A .npy file as an array, and as rays whose results are written again.
#include <cstdlib>

#include "fuzz/fuzz_target.hpp"
#include "io/npy_file.hpp"
#include "io/scene/ray_file.hpp"

namespace raysplats::fuzz {
namespace {

void parse(std::span<const std::uint8_t> input) {
  const std::filesystem::path path = scratch().write("input.npy", input);
  const io::NpyArray array = io::read_npy(path);
  std::size_t count = 1;
  for (const std::size_t size : array.shape) count *= size;
  if (count != array.data.size()) std::abort();
  const io::RayList list = io::read_rays(path);
  const std::vector<RayResult> results(list.rays.size());
  io::write_ray_results(scratch().path() / "results.npz", list.shape, results);
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
