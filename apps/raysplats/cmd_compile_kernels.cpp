// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <string>

#include "commands.hpp"
#include "device/compiler_process.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::string device;
  std::string cache;
};

}  // namespace

// No help names it: the program starts itself by it (ContextOptions::compiler).
Command add_compile_kernels_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("compile-kernels", "Compile what standard input asks for");
  command->group("");
  auto options = std::make_shared<Options>();
  command->add_option("DEVICE", options->device, "Index of the device")->required();
  command->add_option("CACHE", options->cache, "Folder of compiled kernels")->required();
  return {command, [options] { serve_compiler(select_device(options->device), options->cache); }};
}

}  // namespace raysplats::cli
