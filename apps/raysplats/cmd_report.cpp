// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "options.hpp"
#include "raysplats/error.hpp"
#include "report/run_report.hpp"
#include "util/atomic_file.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::vector<std::string> runs;
  std::string output;
};

void run(const Options& options) {
  if (options.runs.size() > 1) {
    if (options.output.empty())
      throw UsageError("Several runs have no one folder for their page: say where by -o FILE");
    write_text_file(options.output, runs_report({options.runs.begin(), options.runs.end()}));
    fmt::print("{}\n", options.output);
    return;
  }
  const std::filesystem::path run = options.runs.front();
  const std::filesystem::path file =
      options.output.empty() ? run / "report.html" : std::filesystem::path(options.output);
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
      ->type_name("FILE");
  return {command, [options] { run(*options); }};
}

}  // namespace raysplats::cli
