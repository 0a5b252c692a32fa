// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <memory>

#include "base/progress.hpp"
#include "eval/output_check.hpp"
#include "options.hpp"
#include "raysplats/trainer.hpp"
#include "report/run_report.hpp"
#include "train/train_config.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::string data;
  std::string output;
  std::string resume;
  bool overwrite = false;
  TrainOptions train;
  DeviceFlags device;
};

/// A resumed run keeps its options; the command line and a --config go before them.
void keep_run_options(CLI::App& command, Options& options) {
  if (options.resume.empty() || command.get_option("--config")->count() > 0) return;
  std::filesystem::path run = options.resume == "latest" ? options.output : options.resume;
  if (!std::filesystem::is_directory(run)) run = run.parent_path().parent_path();
  const std::filesystem::path config = run / "config.toml";
  if (!std::filesystem::exists(config)) return;
  apply_run_config(command, options.train, config);
  validate(options.train);
}

void run(CLI::App& command, Options& options, const GlobalOptions& global) {
  keep_run_options(command, options);
  Dataset dataset = load_dataset(options.data, options.train.data);
  check_not_data(options.output, dataset);
  const std::unique_ptr<Context> context = open_context(options.device);
  Trainer trainer(*context, std::move(dataset), options.train, options.output, options.overwrite);
  if (!options.resume.empty()) trainer.resume(options.resume);
  const TrainSummary summary = trainer.run(!global.quiet);

  fmt::print("{} iterations in {}: {} Gaussians in {}\n", summary.iterations,
             with_compiling(format_duration(summary.training_seconds) + " of training",
                            summary.kernel_build_seconds),
             summary.gaussians, options.output);
  if (!summary.evaluations.empty()) {
    const EvaluationRow& last = summary.evaluations.back();
    fmt::print("PSNR {:.2f} dB, SSIM {:.4f} on {} held-out views\n", last.psnr, last.ssim,
               last.views);
  }
  const std::filesystem::path report = std::filesystem::path(options.output) / "report.html";
  write_run_report(options.output, report);
  fmt::print("Report: {}\n", report.string());
  if (options.device.profile) fmt::print("{}", context->profile_table());
}

}  // namespace

Command add_train_command(CLI::App& app, const GlobalOptions& global) {
  CLI::App* command = app.add_subcommand("train", "Train a model from the photos of a data set");
  auto options = std::make_shared<Options>();
  command->add_option("-d,--data,DATA", options->data, "Data set: COLMAP, nerfstudio or Blender")
      ->required()
      ->type_name("DATA");
  command->add_option("-o,--output", options->output, "Folder for the run")
      ->required()
      ->type_name("RUN");
  command
      ->add_option("--resume", options->resume,
                   "Go on from the newest whole checkpoint of a run, with its options; 'latest' "
                   "means that of --output, or a new start while there is none")
      ->type_name("RUN");
  command->add_flag("--overwrite", options->overwrite,
                    "Take the place of a run that is in the folder: its files are removed");
  add_device_flags(*command, options->device);
  add_train_options(*command, options->train);
  return {command, [command, options, &global] { run(*command, *options, global); }};
}

}  // namespace raysplats::cli
