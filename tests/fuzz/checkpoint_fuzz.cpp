// SPDX-License-Identifier: Apache-2.0
// A checkpoint. The first byte asks for right checksums, so that damage gets past them and meets
// the checks behind.
#include "run/checkpoint.hpp"

#include <xxhash.h>

#include <cstdlib>
#include <cstring>
#include <vector>

#include "fuzz/fuzz_target.hpp"

namespace raysplats::fuzz {
namespace {

constexpr std::size_t kPreambleBytes = 32;
constexpr std::size_t kEntryBytes = 56;

std::uint64_t read_u64(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  std::uint64_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof(value));
  return value;
}

void write_hash(std::vector<std::uint8_t>& bytes,
                std::size_t at,
                std::size_t begin,
                std::size_t count) {
  const std::uint64_t value = XXH64(bytes.data() + begin, count, 0);
  std::memcpy(bytes.data() + at, &value, sizeof(value));
}

// Sets the checksums of whatever lies inside the file, in the format that checkpoint.hpp documents.
void repair(std::vector<std::uint8_t>& bytes) {
  if (bytes.size() < kPreambleBytes) return;
  std::uint32_t sections = 0;
  std::memcpy(&sections, bytes.data() + 12, sizeof(sections));
  const std::uint64_t header = read_u64(bytes, 16);
  if (header > bytes.size() - kPreambleBytes) return;
  write_hash(bytes, 24, kPreambleBytes, header);
  const std::size_t table = kPreambleBytes + header;
  const std::size_t room = bytes.size() - table;
  if (room < 8 || sections > (room - 8) / kEntryBytes) return;
  const std::size_t table_end = table + sections * kEntryBytes;
  for (std::uint32_t i = 0; i < sections; ++i) {
    const std::size_t entry = table + i * kEntryBytes;
    const std::uint64_t offset = read_u64(bytes, entry + 32);
    const std::uint64_t count = read_u64(bytes, entry + 40);
    if (offset < table_end + 8 || offset > bytes.size() || count > bytes.size() - offset) continue;
    write_hash(bytes, entry + 48, offset, count);
  }
  write_hash(bytes, table_end, table, table_end - table);
}

void parse(std::span<const std::uint8_t> input) {
  const bool repaired = take_choice(input, 2) == 1;
  std::vector<std::uint8_t> bytes(input.begin(), input.end());
  if (repaired) repair(bytes);
  const Checkpoint checkpoint = read_checkpoint(scratch().write("input.rsck", bytes));
  const std::filesystem::path copy = scratch().path() / "copy.rsck";
  write_checkpoint(copy, checkpoint);
  if (read_checkpoint(copy).sections.size() != checkpoint.sections.size()) std::abort();
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
