// SPDX-License-Identifier: Apache-2.0
#include "io/file_hash.hpp"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <new>
#include <vector>

namespace raysplats::io {

std::optional<std::string> file_hash(const std::filesystem::path& file,
                                     std::uintmax_t begin,
                                     std::uintmax_t bytes) {
  std::ifstream stream(file, std::ios::binary);
  if (begin > 0) stream.seekg(static_cast<std::streamoff>(begin));
  if (!stream) return std::nullopt;
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(),
                                                                       &XXH3_freeState);
  if (!state) throw std::bad_alloc();
  XXH3_128bits_reset(state.get());
  constexpr std::uintmax_t kPart = std::uintmax_t{1} << 20;
  std::vector<char> part(static_cast<std::size_t>(std::min(kPart, bytes)));
  while (bytes > 0 && stream) {
    stream.read(part.data(), static_cast<std::streamsize>(std::min(kPart, bytes)));
    const auto read = static_cast<std::size_t>(stream.gcount());
    XXH3_128bits_update(state.get(), part.data(), read);
    bytes -= read;
  }
  if (stream.bad()) return std::nullopt;
  const XXH128_hash_t hash = XXH3_128bits_digest(state.get());
  return fmt::format("{:016x}{:016x}", hash.high64, hash.low64);
}

}  // namespace raysplats::io
