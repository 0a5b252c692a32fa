// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <system_error>

#include "commands.hpp"
#include "io/dataset/sized_dataset.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "raysplats/trainer.hpp"
#include "render/output_check.hpp"
#include "report/run_files.hpp"
#include "report/run_report.hpp"
#include "run/checkpoint.hpp"
#include "run/mirror_meshes.hpp"
#include "run/train_config.hpp"
#include "shared_work.hpp"
#include "train/quality_preset.hpp"
#include "util/number_text.hpp"
#include "util/progress.hpp"
#include "util/shell_word.hpp"
#include "validators.hpp"
#include "value_text.hpp"
#include "view/photos.hpp"
#include "view/run_view.hpp"
#include "view/view_state.hpp"
#include "viewer_flags.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::string data;
  std::string output;
  std::string resume;
  std::string time;
  std::string quality;
  bool overwrite = false;
  bool view = false;
  view::ViewerOptions viewer = view_options();
  TrainOptions train;
  DeviceFlags device;
};

/// Keys whose values --time and --quality choose.
struct ChosenKeys {
  std::set<std::string> kept;  ///< as they were chosen, in a run that goes on
  std::set<std::string> anew;  ///< once more, in place of what a run without a checkpoint has named
};

/// --time and --quality choose for a new run what its configuration then names. A command that
/// begins a run or goes on with it may have them each time.
ChosenKeys check_choices(const CLI::App& command, Options& options) {
  const auto given = [&](const char* name) { return command.get_option(name)->count() > 0; };
  ChosenKeys chosen;
  const bool asked = !options.time.empty() || !options.quality.empty();
  if (asked && options.resume == "latest" && !list_checkpoints(options.output).empty()) {
    spdlog::info("--time and --quality are not asked again: {} names what they chose",
                 (std::filesystem::path(options.output) / "config.toml").string());
    chosen.kept = {"iterations"};
    if (!options.time.empty()) chosen.kept.insert("end-iteration");
    if (!options.quality.empty()) chosen.kept.insert("downscale");
    options.time.clear();
    options.quality.clear();
  } else if (asked && options.resume == "latest") {
    chosen.anew = {"iterations",          "end-iteration", "max-gaussians",
                   "resolution-schedule", "photo-points",  "downscale"};
  } else if (asked && !options.resume.empty()) {
    throw UsageError(
        "--time and --quality are about new runs: a resumed one has its length, which "
        "--iterations changes");
  }
  std::error_code error;
  if (!options.resume.empty() && options.resume != "latest" &&
      !std::filesystem::exists(options.resume, error)) {
    throw DataError(fmt::format("--resume {} does not exist: name a run or a checkpoint of one",
                                options.resume));
  }
  if (!options.time.empty() && given("--iterations")) {
    throw UsageError("--time and --iterations contradict each other: leave one of them out");
  }
  if (given("--test-every") && given("--test-list")) refuse_two_splits();
  return chosen;
}

/// Chooses the size of photos, as far as nothing says it, and by --quality the length of the run.
/// `in_files`: as DownscaleChoice has it.
void choose_size(const CLI::App& command,
                 Options& options,
                 const Dataset& dataset,
                 double in_files,
                 const DeviceInfo& device) {
  DatasetOptions& data = options.train.data;
  // On the command line, by a --config or the run that goes on.
  const bool sized = data.downscale > 0;
  if (options.quality.empty()) {
    if (sized) return;
    std::optional<double> seconds;
    if (!options.time.empty()) seconds = parse_duration("--time", options.time);
    data.downscale = fitting_downscale(dataset, device.type, seconds);
  } else {
    const QualityChoice choice =
        choose_quality(parse_quality(options.quality), dataset, device.type);
    const bool given = command.get_option("--iterations")->count() > 0;
    if (!given && options.train.iterations == TrainOptions().iterations)
      options.train.iterations = choice.iterations;
    if (sized) return;
    data.downscale = choice.downscale;
  }
  if (data.downscale == 1) return;
  data.downscale *= in_files;  // it was counted from what was read
  spdlog::info("Photos are reduced {:.3g} times each way{}; --downscale 1 keeps them",
               data.downscale,
               options.quality.empty() ? ", because they are large"
                                       : ", as --quality " + options.quality + " does");
}

Dataset load(const CLI::App& command, Options& options, const DeviceInfo& device) {
  return io::load_sized_dataset(options.data, options.train.data,
                                [&](const Dataset& dataset, double in_files) {
                                  choose_size(command, options, dataset, in_files, device);
                                  return options.train.data.factor();
                                });
}

/// Sets the length of a run by --time, and says beforehand how long it will take. Returns its
/// iterations.
std::int64_t announce(Trainer& trainer, const Options& options, bool quiet, bool show_progress) {
  constexpr double kMeasureSeconds = 3;
  constexpr double kLongSeconds = 3600;
  const bool fits = !options.time.empty();
  if (!fits && (quiet || !options.resume.empty())) return trainer.iterations();
  const RunEstimate estimate =
      fits ? trainer.fit_time(parse_duration("--time", options.time), show_progress)
           : trainer.estimate(kMeasureSeconds, show_progress);
  const bool long_by_default = !fits && options.quality.empty() && estimate.seconds > kLongSeconds;
  std::string more;
  if (estimate.evaluations > 0) {
    more = fmt::format(", not counting {} of {}{}",
                       counted(static_cast<double>(estimate.evaluations), "evaluation"),
                       counted(static_cast<double>(estimate.evaluated_views), "view"),
                       estimate.evaluations > 1 ? " in all" : "");
  }
  spdlog::info("{} iterations, up to {} Gaussians: about {} of training{}{}", estimate.iterations,
               estimate.gaussians, format_duration(estimate.seconds), more,
               long_by_default ? " (--quality medium or --time 30m are shorter)" : "");
  return estimate.iterations;
}

/// Opens the run to browsers.
std::unique_ptr<view::RunView> show(Context& context,
                                    Trainer& trainer,
                                    const Options& options,
                                    const std::vector<View>& views,
                                    const std::array<double, 3>& origin) {
  const Mirrors mirrors = load_mirrors(options.train.mirrors, options.train.mirror_bounces, origin);
  std::vector<Camera> cameras;
  cameras.reserve(views.size());
  for (const View& each : views) cameras.push_back(each.camera);
  view::ViewState state = view::first_look(view::extent_before(cameras), cameras, std::nullopt);
  state.name = report::run_name(options.output);
  state.origin = {origin[0], origin[1], origin[2]};
  state.about = fmt::format("in training on {} of {}", counted(cameras.size(), "photo"),
                            report::run_name(options.data));
  state.has_near = state.has_depth = mirrors.meshes.empty();
  state.near_depth = options.train.trace.near_depth;
  state.trains = state.has_order = state.has_photos = true;
  view::ViewerOptions viewer = options.viewer;
  viewer.state = view::state_json(state);
  const auto photos = std::make_shared<view::Photos>(views, options.train.trace.background);
  viewer.photo = [photos](std::size_t number) { return photos->jpeg(number); };
  auto shown = std::make_unique<view::RunView>(context, trainer.gaussians(), options.train.trace,
                                               mirrors, options.train.iterations, viewer);
  trainer.set_watcher(shown.get());
  fmt::print("Open {} in a browser to watch\n", fmt::join(shown->urls(), " or "));
  std::fflush(stdout);
  return shown;
}

/// The model is what the run was for: no failure of its page fails it. `state` is what the run is.
void report(const std::filesystem::path& folder, const char* state) {
  const std::filesystem::path file = folder / "report.html";
  try {
    const std::string warnings = write_run_report(folder, file);
    fmt::print("Report: {}\n", file.string());
    if (!warnings.empty()) fmt::print("{}\n", warnings);
  } catch (const std::exception& error) {
    spdlog::warn("the run is {}, but has no report: {}; try again by 'raysplats report {}'", state,
                 error.what(), shell_word(folder.string()));
  }
}

void print_results(const TrainSummary& summary, const std::string& folder) {
  fmt::print("{} iterations in {}: {} Gaussians in {}\n", summary.iterations,
             with_compiling(format_duration(summary.training_seconds) + " of training",
                            summary.kernel_build_seconds),
             summary.gaussians, folder);
  if (!summary.evaluations.empty()) {
    const EvaluationRow& last = summary.evaluations.back();
    fmt::print("PSNR {:.2f} dB, SSIM {:.4f} on {}\n", last.psnr, last.ssim,
               counted(last.views, "held-out view"));
  }
  report(folder, "whole");
}

/// Runs to the end. One that is interrupted after its start gets its page too, and who watches
/// hears of any end.
TrainSummary run_to_end(Trainer& trainer,
                        const Options& options,
                        bool show_progress,
                        Communicator& ranks,
                        view::RunView* shown) {
  try {
    return trainer.run(show_progress);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInterrupted && trainer.iteration() > 0) {
      if (ranks.leads()) report(options.output, "saved");
      ranks.barrier();  // of processes, mpirun ends all when the first one fails
    }
    if (shown != nullptr) shown->finish(error.what());
    throw;
  }
}

/// As one of the ranks that share the run.
void train(const CLI::App& command,
           Options options,
           const GlobalOptions& global,
           Communicator& ranks,
           Context& context) {
  const bool show_progress = !global.quiet && ranks.leads();
  Dataset dataset = load(command, options, context.device());
  check_not_data(options.output, dataset);
  std::vector<View> views;
  if (options.view && ranks.leads()) {
    for (const std::size_t index : dataset.indices(Split::kTrain))
      views.push_back(dataset.views[index]);
  }
  const std::array<double, 3> origin = dataset.origin;
  Trainer trainer(context, std::move(dataset), options.train, options.output, options.overwrite,
                  &ranks);
  trainer.set_command(global.command);
  if (!options.resume.empty()) trainer.resume(options.resume);
  options.train.iterations =
      announce(trainer, options, ranks.broadcast_value(0, global.quiet), show_progress);
  std::unique_ptr<view::RunView> shown;
  if (options.view && ranks.leads()) shown = show(context, trainer, options, views, origin);
  const std::int64_t begun = trainer.iteration();
  const Communicator::Traffic before = ranks.traffic();
  const TrainSummary summary = run_to_end(trainer, options, show_progress, ranks, shown.get());
  if (!ranks.leads()) return;

  print_results(summary, options.output);
  if (shown)
    shown->finish(fmt::format("The run has ended: raysplats view {}", shell_word(options.output)));
  if (!options.device.profile) return;
  fmt::print("{}{}", context.profile_table(),
             traffic_of(ranks, before, summary.iterations - begun, "step"));
}

void run(CLI::App& command, Options& options, const GlobalOptions& global) {
  const ChosenKeys chosen = check_choices(command, options);
  if (!options.time.empty()) parse_duration("--time", options.time);  // before anything is loaded
  if (!options.resume.empty()) {
    apply_resumed_options(command, options.train,
                          options.resume == "latest" ? options.output : options.resume, chosen.kept,
                          chosen.anew);
  } else if (command.get_option("--iterations")->count() > 0 &&
             command.get_option("--end-iteration")->count() == 0) {
    options.train.end_iteration = 0;  // of a run by time, whose configuration --config has named
  }
  share_work(options.device, global, [&](Communicator& ranks, Context& context) {
    train(command, options, global, ranks, context);
  });
}

}  // namespace

Command add_train_command(CLI::App& app, const GlobalOptions& global) {
  CLI::App* command = app.add_subcommand("train", "Train a model from the photos of a data set");
  auto options = std::make_shared<Options>();
  command
      ->add_option("-d,--data,DATA", options->data,
                   "Data set: COLMAP, nerfstudio, Blender, LLFF or Polycam")
      ->required()
      ->type_name("DATA");
  command->add_option("-o,--output", options->output, "Folder for the run")
      ->required()
      ->check(not_empty())
      ->type_name("RUN");
  command
      ->add_option("--resume", options->resume,
                   "Go on from the newest whole checkpoint of a run, with its options; 'latest' "
                   "means that of --output, or a new start while there is none")
      ->type_name("RUN");
  command
      ->add_option("--time", options->time,
                   "Train for that long (90s, 15m, 1.5h), evaluations not counted: measures a "
                   "twentieth of it, then fixes --iterations and --max-gaussians, which "
                   "RUN/config.toml names")
      ->type_name("TIME");
  command
      ->add_option("--quality", options->quality,
                   "Choose --iterations and --downscale from the photos and the device: preview, "
                   "low, medium or high; what is given beside it stays")
      ->check(one_of(quality_names()))
      ->type_name("LEVEL");
  command->add_flag("--overwrite", options->overwrite,
                    "Take the place of a run that is in the folder: its files are removed");
  CLI::Option* view = command->add_flag(
      "--view", options->view,
      "Show the model in a browser while it trains; the page pauses, resumes and saves the run");
  for (CLI::Option* option : add_viewer_flags(*command, options->viewer)) option->needs(view);
  add_device_flags(*command, options->device);
  add_train_options(*command, options->train);
  return {command, [command, options, &global] { run(*command, *options, global); }};
}

}  // namespace raysplats::cli
