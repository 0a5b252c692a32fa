// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>

#include "unit/temporary_directory.hpp"
#include "unit/text.hpp"

namespace raysplats::test {

namespace fs = std::filesystem;

using Scratch = TemporaryDirectory;

/// Appends the little-endian bytes of a number.
template <class T>
void put(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes.append(raw, sizeof(T));
}

/// A folder of real data sets, when the environment names one.
inline std::optional<fs::path> test_data() {
  const char* folder = std::getenv("RAYSPLATS_TEST_DATA");
  if (folder == nullptr || *folder == '\0') return std::nullopt;
  return fs::path(folder);
}

}  // namespace raysplats::test
