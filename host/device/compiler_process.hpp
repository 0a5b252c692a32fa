// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "raysplats/context.hpp"
#include "util/program.hpp"

namespace raysplats {

/// Compiles kernel programs in a process of its own, which leaves them in the cache: drivers that
/// compile one program of a process at a time (PoCL, Intel's for CPUs) compile several that way.
class CompilerProcess {
 public:
  /// Starts `program`, which has to call serve_compiler(), with the arguments compile-kernels, the
  /// index of the device and the folder of the cache. Throws Error when it cannot be started.
  CompilerProcess(const std::filesystem::path& program,
                  const DeviceInfo& device,
                  const std::filesystem::path& cache);

  /// Waits until the file `path` below cl/ is compiled. Throws Error when that has failed or the
  /// process has ended.
  void compile(const std::string& path, const std::string& flags);

 private:
  ProgramInput program_;
};

/// What that process does: compiles what the channel on standard input asks for, and answers there,
/// until the channel is closed.
void serve_compiler(const DeviceInfo& device, const std::string& cache_directory);

}  // namespace raysplats
