// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace raysplats::fuzz {

/// A folder of this process that goes with it, in shared memory where there is any.
class ScratchFolder {
 public:
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }
  /// Replaces a file of the folder and returns its path.
  std::filesystem::path write(const std::string& name, std::span<const std::uint8_t> bytes) const;

 private:
  std::filesystem::path path_;
};

/// The folder of this process. Making it also silences the log.
const ScratchFolder& scratch();

/// Takes the choice of a target off the front of its input: 0 .. count - 1, 0 for no input.
std::size_t take_choice(std::span<const std::uint8_t>& input, std::size_t count);

/// What every parser promises: it returns, or throws raysplats::Error. Any other exception leaves
/// this function and ends the process, which is a finding.
void check(void (*parse)(std::span<const std::uint8_t>), std::span<const std::uint8_t> input);

}  // namespace raysplats::fuzz

/// Defines the entry point of libFuzzer for `parse`, a function of the input's bytes.
#define RS_FUZZ_TARGET(parse)                                                         \
  extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);  \
  extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) { \
    raysplats::fuzz::check(parse, std::span<const std::uint8_t>(data, size));         \
    return 0;                                                                         \
  }
