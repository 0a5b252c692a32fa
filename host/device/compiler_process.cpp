// SPDX-License-Identifier: Apache-2.0
#include "device/compiler_process.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <span>

#include "device/platform.hpp"
#include "device/program_builder.hpp"
#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr const char* kCommand = "compile-kernels";
// A request is a line of the file and its flags, the answer one of these lines.
constexpr char kBetween = '\t';
constexpr const char* kMade = "made";
constexpr const char* kFailed = "failed";

void answer(const std::string& line) {
  const std::string bytes = line + "\n";
  static_cast<void>(::send(STDIN_FILENO, bytes.data(), bytes.size(), MSG_NOSIGNAL));
}

}  // namespace

CompilerProcess::CompilerProcess(const std::filesystem::path& program,
                                 const DeviceInfo& device,
                                 const std::filesystem::path& cache)
    : program_(program, {kCommand, fmt::format("{}", device.index), cache.string()}) {}

void CompilerProcess::compile(const std::string& path, const std::string& flags) {
  const std::string request = fmt::format("{}{}{}\n", path, kBetween, flags);
  program_.write(std::as_bytes(std::span(request)));
  if (program_.read_line() != kMade)
    throw Error(ErrorCode::kRuntime, fmt::format("{} was not compiled", path));
}

void serve_compiler(const DeviceInfo& device, const std::string& cache_directory) {
  ContextOptions options;
  options.cache_directory = cache_directory;
  const cl::Device handle = platform_devices().at(device.index).device;
  ProgramBuilder builder(cl::Context(handle), handle, device, options);
  std::string line;
  while (true) {
    char byte = 0;
    const ssize_t count = ::read(STDIN_FILENO, &byte, 1);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return;
    if (byte != '\n') {
      line += byte;
      continue;
    }
    const std::size_t path = line.find(kBetween);
    try {
      builder.compile_for_cache(line.substr(0, path), line.substr(path + 1));
      answer(kMade);
    } catch (const Error&) {
      answer(kFailed);  // who asked compiles it again and says why
    }
    line.clear();
  }
}

}  // namespace raysplats
