// SPDX-License-Identifier: Apache-2.0
// A file of the kernel cache. Only what store() wrote may come back, so anything else than a whole
// file with its checksum has to be refused; the first byte asks for a right checksum.
#include <xxhash.h>

#include <cstdlib>
#include <cstring>
#include <vector>

#include "device/program_cache.hpp"
#include "fuzz/fuzz_target.hpp"

namespace raysplats::fuzz {
namespace {

constexpr std::size_t kHeaderBytes = 24;

void parse(std::span<const std::uint8_t> input) {
  const bool repair = take_choice(input, 2) == 1;
  std::vector<std::uint8_t> bytes(input.begin(), input.end());
  if (repair && bytes.size() >= kHeaderBytes) {
    const std::uint64_t checksum =
        XXH3_64bits(bytes.data() + kHeaderBytes, bytes.size() - kHeaderBytes);
    std::memcpy(bytes.data() + 16, &checksum, sizeof(checksum));
  }
  scratch().write("key.bin", bytes);
  const ProgramCache cache(scratch().path().string());
  const auto binary = cache.load("key");
  if (!binary) return;
  if (bytes.size() < kHeaderBytes || binary->size() != bytes.size() - kHeaderBytes) std::abort();
  cache.store("copy", *binary);
  if (cache.load("copy") != binary) std::abort();
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
