// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <new>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "commands.hpp"
#include "help.hpp"
#include "logging.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "shared_work.hpp"
#include "util/interrupt.hpp"
#include "util/memory_limit.hpp"
#include "util/standard_streams.hpp"

namespace {

using raysplats::cli::GlobalOptions;

int fail(GlobalOptions& global, raysplats::ErrorCode code, const std::string& message) {
  return raysplats::cli::fail_together(global.processes, raysplats::Error(code, message));
}

std::string no_memory() {
  return fmt::format(
      "The host has no memory left{}: use fewer Gaussians, smaller images (--downscale) or a "
      "smaller --memory-budget",
      raysplats::memory_limit_remark());
}

// Drivers and libraries have threads of their own, out of reach of main(); some of them meet the
// end of memory. Other processes of the work are ended by mpirun.
[[noreturn]] void end_of_process() {
  auto code = raysplats::ErrorCode::kRuntime;
  std::string message;
  try {
    if (const std::exception_ptr error = std::current_exception()) std::rethrow_exception(error);
    message = fmt::format("A library ended the program{}", raysplats::memory_limit_remark());
  } catch (const std::bad_alloc&) {
    code = raysplats::ErrorCode::kMemory;
    message = no_memory();
  } catch (const std::exception& error) {
    message = error.what();
  }
  std::fputs(fmt::format("raysplats: {}\n", message).c_str(), stderr);
  std::_Exit(static_cast<int>(code));
}

int run(int argc, char** argv, GlobalOptions& global) {
  using namespace raysplats::cli;
  CLI::App app{"Trains and renders 3D Gaussians by ray tracing on any OpenCL device", "raysplats"};
  app.set_version_flag("--version", "raysplats " RAYSPLATS_VERSION);
  app.formatter(std::make_shared<HelpFormatter>());
  app.set_help_flag("-h,--help", "Print this help message and exit");
  app.set_help_all_flag("--help-all", "Print help with every option and exit");
  app.require_subcommand(1);
  app.fallthrough();
  add_global_options(app, global);
  global.command = command_line(argc, argv);
  const std::vector<Command> commands{
      add_devices_command(app),        add_doctor_command(app),
      add_generate_command(app),       add_prepare_command(app, global),
      add_train_command(app, global),  add_render_command(app, global),
      add_eval_command(app, global),   add_trace_command(app),
      add_info_command(app),           add_convert_command(app),
      add_view_command(app),           add_report_command(app),
      add_bench_command(app),          add_tune_command(app),
      add_completion_command(app),     add_manual_command(app),
      add_compile_kernels_command(app)};
  try {
    std::vector<std::string> arguments = own_arguments(argc, argv);
    std::reverse(arguments.begin(), arguments.end());  // the order that CLI11 takes them in
    app.parse(std::move(arguments));
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {
      app.exit(error);
      raysplats::finish_standard_output();
      return 0;
    }
    return fail(global, raysplats::ErrorCode::kUsage, explain(error, app));
  }
  for (const Command& command : commands) {
    if (!command.app->parsed()) continue;
    global.processes = join_processes(command.app->get_name());
    if (!global.processes.leads()) global.quiet = true;
    start_logging(global.log_level, global.quiet);
    command.run();
  }
  raysplats::finish_standard_output();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  // A file over the process's size limit is then a failed write like any other, not the end of the
  // process.
  std::signal(SIGXFSZ, SIG_IGN);
  raysplats::keep_ignoring_hang_ups();
  std::set_terminate(end_of_process);
  raysplats::open_standard_streams();
  // Known here, because run() may end by an exception.
  GlobalOptions global;
  try {
    return run(argc, argv, global);
  } catch (const raysplats::Error& error) {
    return raysplats::cli::fail_together(global.processes, error);
  } catch (const std::bad_alloc&) {
    return fail(global, raysplats::ErrorCode::kMemory, no_memory());
  } catch (const std::system_error& error) {
    // fmt throws it for what does not fit into the buffer of standard output.
    if (std::ferror(stdout) == 0) return fail(global, raysplats::ErrorCode::kRuntime, error.what());
    return fail(global, raysplats::ErrorCode::kData,
                fmt::format("Standard output cannot be written: {}", error.code().message()));
  } catch (const std::exception& error) {
    return fail(global, raysplats::ErrorCode::kRuntime, error.what());
  }
}
