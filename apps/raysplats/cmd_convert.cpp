// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "io/dataset/dataset_views.hpp"
#include "io/model/convert_model.hpp"
#include "io/model/model_file.hpp"
#include "options.hpp"
#include "raysplats/contributions.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "run/mirror_meshes.hpp"
#include "run/model_source.hpp"
#include "run/run_cameras.hpp"
#include "util/atomic_file.hpp"
#include "util/interrupt.hpp"
#include "util/number_text.hpp"
#include "validators.hpp"
#include "value_text.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::string input;
  std::string output;
  std::optional<std::string> up;
  std::optional<std::string> rotate;
  std::string max_gaussians;
  std::optional<std::string> translate;
  std::optional<std::string> crop;
  std::optional<std::string> crop_min;
  std::optional<std::string> crop_max;
  std::string spz_axes = "ply";
  int spz_version = ModelEncoding{}.spz_version;
  bool drop_nonfinite = false;
  bool overwrite = false;
  std::string data;
  DeviceFlags device;
  ModelChanges changes;
};

glm::dvec3 vector_of(const std::string& text) {
  const std::array<double, 3> v = parse_triple(text);
  return {v[0], v[1], v[2]};
}

/// The views that a model is to be good for: those of a data set, or of its run.
std::vector<Camera> views_of(const Options& options, const ModelSource& source) {
  if (options.data.empty()) return run_cameras(source);
  DatasetOptions data = dataset_options(source);
  data.test_list.reset();  // all count, also of other data than the run's
  return cameras_of(load_dataset(options.data, data), Split::kAll);
}

std::vector<double> weights(const Options& options,
                            const ModelSource& source,
                            const ModelEncoding& encoding) {
  const std::vector<Camera> cameras = views_of(options, source);
  if (cameras.empty()) {
    spdlog::info("no views are known (--data): the largest and most opaque Gaussians are kept");
    return {};
  }
  const std::string share =
      cameras.size() > kMostContributionViews ? fmt::format("{} of ", kMostContributionViews) : "";
  spdlog::info("what is seen in {}{} is kept", share, counted(cameras.size(), "view"));
  const std::unique_ptr<Context> context = open_context(options.device);
  return contributions(*context, read_model(source.file, encoding), cameras, trace_options(source),
                       mirrors_of(source));
}

void run(Options& options) {
  ModelChanges& changes = options.changes;
  if (options.up) changes.up = vector_of(*options.up);
  if (!options.max_gaussians.empty())
    changes.max_gaussians = parse_count("--max-gaussians", options.max_gaussians);
  if (options.rotate) changes.rotate_degrees = vector_of(*options.rotate);
  if (options.translate) changes.translate = vector_of(*options.translate);
  if (options.crop) {
    const std::array<double, 6> b = parse_box(*options.crop);
    changes.crop = Bounds{{b[0], b[1], b[2]}, {b[3], b[4], b[5]}};
  }
  if (options.crop_min || options.crop_max) {
    changes.crop.emplace();
    if (options.crop_min) changes.crop->low = parse_triple(*options.crop_min);
    if (options.crop_max) changes.crop->high = parse_triple(*options.crop_max);
  }
  const ModelSource source = find_model(options.input);
  // Before the views are traced for what is kept.
  io::output_format(options.output);
  check_output_file(options.output, options.overwrite, {source.file});
  std::optional<TraceOptions> trace;
  if (source.header || source.trained) trace = trace_options(source);
  const ModelEncoding encoding{options.spz_axes == "rub" ? SpzAxes::kRub : SpzAxes::kPly,
                               options.spz_version, options.drop_nonfinite};
  if (changes.max_gaussians) {
    changes.contributions = weights(options, source, encoding);
  } else if (!options.data.empty()) {
    throw UsageError("--data has the views that --max-gaussians goes by: give that as well");
  }
  // A file that is begun is completed, or removed.
  const InterruptGuard interrupt;
  const Conversion done =
      convert_model(source.file, options.output, changes, encoding, trace, options.overwrite);
  const std::string left = done.written == done.read ? "" : fmt::format(" of {}", done.read);
  fmt::print("{}{} Gaussians, SH degree {}, in {}: {}\n", done.written, left, done.sh_degree,
             options.output, done.losses);
}

}  // namespace

Command add_convert_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("convert", "Write a model in another format, or a part of it");
  auto options = std::make_shared<Options>();
  ModelChanges& changes = options->changes;
  command
      ->add_option(
          "MODEL", options->input,
          "PLY, compressed PLY, .splat, SPZ, SOG (its folder too) or glTF with Gaussians, or a "
          "run folder")
      ->required()
      ->type_name("");
  command
      ->add_option(
          "-o,--output,OUT", options->output,
          "What to write, by its ending: .ply, .compressed.ply, .splat, .spz, .sog or .glb")
      ->required()
      ->check(not_empty())
      ->type_name("FILE");
  command->add_option("--sh-degree", changes.sh_degree, "Keep or fill up this many SH degrees")
      ->transform(whole_between(0, 4));
  command->add_option("--min-opacity", changes.min_opacity, "Leave out Gaussians that are fainter")
      ->check(between(0.0, 1.0));
  command->add_flag(
      "--drop-nonfinite", options->drop_nonfinite,
      "Leave out Gaussians of a PLY, .splat or glTF with numbers that are not finite");
  command
      ->add_option(
          "--max-gaussians", options->max_gaussians,
          "Keep the N (such as 500k) that contribute most to the views of --data or the run; "
          "of other models the largest and most opaque")
      ->type_name("N");
  command->add_option("--data", options->data, "Data set with the views of --max-gaussians")
      ->type_name("DIR");
  command
      ->add_option("--up", options->up,
                   "Turn the model so that this direction is up, before everything else")
      ->check(triple())
      ->type_name("X,Y,Z");
  command->add_option("--scale", changes.scale, "Make the model this much larger")
      ->check(above(0.0))
      ->capture_default_str();
  command
      ->add_option("--rotate", options->rotate,
                   "Degrees about the axes x, then y, then z; 180,0,0 turns a model over")
      ->check(triple())
      ->type_name("X,Y,Z");
  command->add_option("--translate", options->translate, "Move the scaled and turned model")
      ->check(triple())
      ->type_name("X,Y,Z");
  CLI::Option* crop =
      command
          ->add_option("--crop", options->crop,
                       "Leave out Gaussians outside a box in the coordinates of the result: its "
                       "least and greatest x, y, z, as in -1,-1,0,1,1,2")
          ->check(box())
          ->type_name("LIST");
  command->add_option("--crop-min", options->crop_min, "The same by its sides: what is below goes")
      ->check(triple())
      ->excludes(crop)
      ->type_name("X,Y,Z");
  command->add_option("--crop-max", options->crop_max, "What is above goes")
      ->check(triple())
      ->excludes(crop)
      ->type_name("X,Y,Z");
  command
      ->add_option(
          "--spz-axes", options->spz_axes,
          "Axes of an SPZ that is written, or read and does not declare its own: those of the PLY "
          "(what most files hold), or right, up, back as its specification says (rub)")
      ->check(one_of({"ply", "rub"}))
      ->capture_default_str();
  command->add_option("--spz-version", options->spz_version, "3 (gzip) or 4 (zstd)")
      ->transform(whole_between(3, 4))
      ->capture_default_str();
  add_overwrite_flag(*command, options->overwrite, kOverwriteFile);
  add_device_flags(*command, options->device);
  return {command, [options] { run(*options); }};
}

}  // namespace raysplats::cli
