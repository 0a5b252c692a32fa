// SPDX-License-Identifier: Apache-2.0
#include "util/standard_streams.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>

#include "raysplats/error.hpp"

namespace raysplats {

void open_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(stream, F_GETFD) >= 0 || errno != EBADF) continue;
    // The lowest free number, which is that of the stream.
    [[maybe_unused]] const int opened = ::open("/dev/null", O_RDWR);
  }
}

void finish_standard_output() {
  errno = 0;
  std::cout.flush();
  const bool flushed = std::fflush(stdout) == 0;
  if (flushed && std::cout.good() && std::ferror(stdout) == 0) return;
  throw DataError(fmt::format("Standard output cannot be written: {}",
                              errno != 0 ? std::strerror(errno) : "an earlier write failed"));
}

}  // namespace raysplats
