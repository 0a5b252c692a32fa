// SPDX-License-Identifier: Apache-2.0
// An LPIPS network: loaded, and run on two tiny images.
#include "fuzz/fuzz_target.hpp"
#include "raysplats/image.hpp"
#include "raysplats/lpips.hpp"

namespace raysplats::fuzz {
namespace {

void parse(std::span<const std::uint8_t> input) {
  Lpips network(scratch().write("network.onnx", input));
  network.distance(Image(16, 16, 3, 0.25f), Image(16, 16, 3, 0.75f));
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
