// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace raysplats::cli {

struct GlobalOptions;

/// A command of the program; `run` is called after everything has been parsed.
struct Command {
  CLI::App* app = nullptr;
  std::function<void()> run;
};
Command add_devices_command(CLI::App& app);
Command add_doctor_command(CLI::App& app);
Command add_generate_command(CLI::App& app);
Command add_prepare_command(CLI::App& app, const GlobalOptions& global);
Command add_train_command(CLI::App& app, const GlobalOptions& global);
Command add_render_command(CLI::App& app, const GlobalOptions& global);
Command add_eval_command(CLI::App& app, const GlobalOptions& global);
Command add_trace_command(CLI::App& app);
Command add_info_command(CLI::App& app);
Command add_convert_command(CLI::App& app);
Command add_view_command(CLI::App& app);
Command add_report_command(CLI::App& app);
Command add_bench_command(CLI::App& app);
Command add_tune_command(CLI::App& app);
Command add_completion_command(CLI::App& app);
Command add_manual_command(CLI::App& app);
Command add_compile_kernels_command(CLI::App& app);

}  // namespace raysplats::cli
