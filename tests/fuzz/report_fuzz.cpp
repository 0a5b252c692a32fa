// SPDX-License-Identifier: Apache-2.0
// A result of `raysplats bench`.
#include "bench/report.hpp"
#include "fuzz/fuzz_target.hpp"

namespace raysplats::fuzz {
namespace {

void parse(std::span<const std::uint8_t> input) {
  bench_json(read_bench_report(scratch().write("report.json", input)));
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
