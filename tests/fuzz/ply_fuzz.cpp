// SPDX-License-Identifier: Apache-2.0
// A PLY as a model, as points, and once more after writing the model.
#include <cstdlib>

#include "fuzz/fuzz_target.hpp"
#include "io/dataset/ply_points.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"

namespace raysplats::fuzz {
namespace {

void parse(std::span<const std::uint8_t> input) {
  const std::filesystem::path path = scratch().write("input.ply", input);
  try {
    io::read_ply_points(path);
  } catch (const Error&) {
    // It may still hold a model.
  }
  const Gaussians model = read_ply(path);
  const std::filesystem::path copy = scratch().path() / "copy.ply";
  write_ply(copy, model);
  if (read_ply(copy).size() != model.size()) std::abort();
  read_ply_options(path);
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
