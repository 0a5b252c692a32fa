// SPDX-License-Identifier: Apache-2.0
#include "io/json_file.hpp"

#include <fmt/format.h>

#include <cstdint>

#include "io/byte_reader.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {
constexpr std::uint64_t kMaxBytes = std::uint64_t{256} << 20;
constexpr int kMaxDepth = 32;
}  // namespace

nlohmann::json read_json_object(const std::filesystem::path& path) {
  return parse_json_object(read_file(path, kMaxBytes), path);
}

nlohmann::json parse_json_object(std::span<const std::byte> bytes,
                                 const std::filesystem::path& path) {
  const auto* begin = reinterpret_cast<const char*>(bytes.data());
  const auto check_depth = [&](int depth, nlohmann::json::parse_event_t, nlohmann::json&) {
    if (depth > kMaxDepth) {
      throw DataError(
          fmt::format("{} is nested more than {} levels deep", path.string(), kMaxDepth));
    }
    return true;
  };
  nlohmann::json root;
  try {
    root = nlohmann::json::parse(begin, begin + bytes.size(), check_depth);
  } catch (const nlohmann::json::parse_error& error) {
    throw DataError(
        fmt::format("{} is no valid JSON: syntax error at byte {}", path.string(), error.byte));
  } catch (const nlohmann::json::exception&) {
    throw DataError(fmt::format("{} is no valid JSON: a number is out of range", path.string()));
  }
  if (!root.is_object()) throw DataError(fmt::format("{} holds no JSON object", path.string()));
  return root;
}

}  // namespace raysplats::io
