// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "commands.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "report/run_report.hpp"
#include "util/atomic_file.hpp"
#include "validators.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::vector<std::string> runs;
  std::string output;
  bool overwrite = false;
};

/// A page takes the place of nothing that it is about.
void check_page(const Options& options, const std::filesystem::path& file) {
  for (const std::string& run : options.runs) {
    for (const std::filesystem::path& input : report_inputs(run))
      check_output_file(file, true, {input});
  }
  check_output_file(file, options.overwrite);
}

void run(const Options& options) {
  if (options.runs.size() > 1) {
    if (options.output.empty())
      throw UsageError("Several runs have no one folder for their page: say where by -o FILE");
    check_page(options, options.output);
    write_text_file(options.output, runs_report({options.runs.begin(), options.runs.end()}));
    fmt::print("{}\n", options.output);
    return;
  }
  const std::filesystem::path run = options.runs.front();
  // A run's own page is made anew.
  const std::filesystem::path own = run / "report.html";
  const std::filesystem::path file =
      options.output.empty() ? own : std::filesystem::path(options.output);
  std::error_code error;
  if (file != own && !std::filesystem::equivalent(file, own, error)) check_page(options, file);
  write_run_report(run, file);
  fmt::print("{}\n", file.string());
}

}  // namespace

Command add_report_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("report", "Write a page about a training run, or several side by side");
  auto options = std::make_shared<Options>();
  command->add_option("RUN", options->runs, "Folders of training runs")->required()->type_name("");
  command
      ->add_option("-o,--output", options->output,
                   "HTML file (default: report.html in the run; needed for several)")
      ->check(not_empty())
      ->type_name("FILE");
  add_overwrite_flag(*command, options->overwrite, kOverwriteFile);
  return {command, [options] { run(*options); }};
}

}  // namespace raysplats::cli
