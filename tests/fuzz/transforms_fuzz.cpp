// SPDX-License-Identifier: Apache-2.0
// A transforms.json as a list of cameras, and as a data set whose photos do not exist.
#include "fuzz/fuzz_target.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"

namespace raysplats::fuzz {
namespace {

void parse(std::span<const std::uint8_t> input) {
  const std::filesystem::path path = scratch().write("transforms.json", input);
  try {
    load_dataset(scratch().path(), {});
  } catch (const Error&) {
    // It may still hold cameras.
  }
  write_cameras(scratch().path() / "copy.json", read_cameras(path));
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
