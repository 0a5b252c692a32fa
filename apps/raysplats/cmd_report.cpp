// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>

#include "options.hpp"
#include "report/run_report.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::string run;
  std::string output;
};

void run(const Options& options) {
  const std::filesystem::path file = options.output.empty()
                                         ? std::filesystem::path(options.run) / "report.html"
                                         : std::filesystem::path(options.output);
  write_run_report(options.run, file);
  fmt::print("{}\n", file.string());
}

}  // namespace

Command add_report_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("report", "Write a page about a training run: curves, views, settings");
  auto options = std::make_shared<Options>();
  command->add_option("RUN", options->run, "Folder of a training run")->required()->type_name("");
  command->add_option("-o,--output", options->output, "HTML file (default: report.html in the run)")
      ->type_name("FILE");
  return {command, [options] { run(*options); }};
}

}  // namespace raysplats::cli
