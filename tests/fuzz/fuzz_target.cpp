// SPDX-License-Identifier: Apache-2.0
#include "fuzz/fuzz_target.hpp"

#include <spdlog/spdlog.h>
#include <stdlib.h>

#include <cstdlib>
#include <fstream>
#include <stdexcept>

#include "raysplats/error.hpp"

namespace raysplats::fuzz {

ScratchFolder::ScratchFolder() {
  std::error_code error;
  const bool shared_memory = std::filesystem::is_directory("/dev/shm", error);
  std::string name = ((shared_memory ? std::filesystem::path("/dev/shm")
                                     : std::filesystem::temp_directory_path()) /
                      "raysplats-fuzz-XXXXXX")
                         .string();
  if (::mkdtemp(name.data()) == nullptr) {
    throw std::runtime_error("no folder for scratch files can be made");
  }
  path_ = name;
}

ScratchFolder::~ScratchFolder() {
  std::error_code error;
  std::filesystem::remove_all(path_, error);
}

std::filesystem::path ScratchFolder::write(const std::string& name,
                                           std::span<const std::uint8_t> bytes) const {
  const std::filesystem::path path = path_ / name;
  std::ofstream stream(path, std::ios::binary | std::ios::trunc);
  stream.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  if (!stream.flush()) throw std::runtime_error(path.string() + " cannot be written");
  return path;
}

const ScratchFolder& scratch() {
  static const ScratchFolder folder;
  static const bool silent = [] {
    spdlog::set_level(spdlog::level::off);
    return true;
  }();
  static_cast<void>(silent);
  return folder;
}

std::size_t take_choice(std::span<const std::uint8_t>& input, std::size_t count) {
  if (input.empty()) return 0;
  const std::size_t choice = input[0] % count;
  input = input.subspan(1);
  return choice;
}

void check(void (*parse)(std::span<const std::uint8_t>), std::span<const std::uint8_t> input) {
  try {
    parse(input);
  } catch (const Error&) {
    // An input that is refused.
  }
}

}  // namespace raysplats::fuzz
