// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <string>

#include "commands.hpp"
#include "options.hpp"
#include "prepare/prepare.hpp"
#include "raysplats/error.hpp"
#include "run/model_source.hpp"
#include "util/interrupt.hpp"
#include "util/number_text.hpp"
#include "util/progress.hpp"
#include "util/shell_word.hpp"
#include "validators.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::string input;
  std::string output;
  std::string matching = "auto";
  std::string cameras = "size";
  PrepareOptions prepare;
};

/// A bar for each step.
class Steps {
 public:
  explicit Steps(bool quiet) : quiet_(quiet) {}

  bool hear(const std::string& step, std::size_t done, std::size_t total) {
    if (step != step_) {
      if (bar_) bar_->finish();
      step_ = step;
      bar_ = std::make_unique<Progress>(
          step, total == 0 ? Progress::kUnknown : static_cast<std::int64_t>(total), 0,
          quiet_ ? nullptr : stderr);
    }
    bar_->update(static_cast<std::int64_t>(done), "");
    return !interrupt_.requested();
  }
  void finish() {
    if (bar_) bar_->finish();
  }

 private:
  bool quiet_;
  InterruptGuard interrupt_;
  std::string step_;
  std::unique_ptr<Progress> bar_;
};

void run(Options& options, const GlobalOptions& global) {
  if (options.matching == "exhaustive") options.prepare.matching = Matching::kExhaustive;
  if (options.matching == "sequential") options.prepare.matching = Matching::kSequential;
  if (options.cameras == "folder") options.prepare.cameras = Cameras::kFolder;
  if (options.cameras == "photo") options.prepare.cameras = Cameras::kPhoto;
  if (is_run_folder(options.output)) {
    throw UsageError(
        fmt::format("The output folder {} is a run: choose another with -o", options.output));
  }
  Steps steps(global.quiet);
  const Prepared made =
      prepare_data(options.input, options.output, options.prepare,
                   [&](const std::string& step, std::size_t done, std::size_t total) {
                     return steps.hear(step, done, total);
                   });
  steps.finish();
  if (!made.without_pose.empty()) {
    constexpr std::size_t kNamed = 10;
    const std::size_t named = std::min(kNamed, made.without_pose.size());
    spdlog::warn("{} without a pose, not used: {}{}", counted(made.without_pose.size(), "photo"),
                 fmt::join(made.without_pose.begin(),
                           made.without_pose.begin() + static_cast<std::ptrdiff_t>(named), ", "),
                 named < made.without_pose.size() ? ", ..." : "");
  }
  fmt::print("{} of {} photos with poses and {} in {}; next: raysplats train {} -o RUN\n",
             made.photos - made.without_pose.size(), made.photos, counted(made.points, "point"),
             options.output, shell_word(options.output));
}

}  // namespace

Command add_prepare_command(CLI::App& app, const GlobalOptions& global) {
  CLI::App* command =
      app.add_subcommand("prepare", "Make a data set of photos or a video, by COLMAP and FFmpeg");
  auto options = std::make_shared<Options>();
  command->add_option("PHOTOS", options->input, "Folder of photos, or a video")
      ->required()
      ->type_name("");
  command->add_option("-o,--output", options->output, "Folder for the data set")
      ->required()
      ->check(not_empty())
      ->type_name("DATA");
  command->add_option("--frames", options->prepare.frames, "Frames to take of a video")
      ->transform(whole_between(3, 100000))
      ->capture_default_str();
  command
      ->add_option("--matching", options->matching,
                   "Compare every pair of photos (exhaustive) or neighbours by name (sequential); "
                   "auto: sequential for videos and more than 400 photos")
      ->check(one_of({"auto", "exhaustive", "sequential"}))
      ->capture_default_str();
  command
      ->add_option("--cameras", options->cameras,
                   "Photos of equal size are of one camera (size), if they are in one folder "
                   "(folder), or each is of its own (photo)")
      ->check(one_of({"size", "folder", "photo"}))
      ->capture_default_str();
  command->add_flag("--subfolders", options->prepare.subfolders,
                    "Take the photos of all folders below PHOTOS too");
  command
      ->add_option("--features", options->prepare.features,
                   "Features of a photo at most; 0 chooses: 8192, fewer for more than 100 photos")
      ->transform(whole_between(0, 100000))
      ->capture_default_str();
  command
      ->add_option("--max-size", options->prepare.max_size,
                   "Longer side in pixels at which features are looked for")
      ->transform(whole_between(100, 20000))
      ->capture_default_str();
  command->add_option("--camera-model", options->prepare.camera_model, "COLMAP's model of the lens")
      ->check(one_of(
          {"SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE"}))
      ->capture_default_str();
  return {command, [options, &global] { run(*options, global); }};
}

}  // namespace raysplats::cli
