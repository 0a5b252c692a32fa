// SPDX-License-Identifier: Apache-2.0
#include "util/output_directory.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "raysplats/error.hpp"

namespace raysplats {

void make_output_directory(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error || !std::filesystem::is_directory(path, error)) {
    throw DataError(fmt::format("The output folder {} cannot be created ({}): choose another",
                                path.string(), error ? error.message() : "a file is in the way"));
  }
  if (::access(path.c_str(), W_OK | X_OK) != 0) {
    throw DataError(fmt::format("The output folder {} cannot be written to ({}): choose another",
                                path.string(), std::strerror(errno)));
  }
}

}  // namespace raysplats
