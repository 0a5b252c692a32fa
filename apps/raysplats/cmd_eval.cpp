// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "commands.hpp"
#include "eval/former_pictures.hpp"
#include "frame_progress.hpp"
#include "model_argument.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "raysplats/evaluation.hpp"
#include "raysplats/io.hpp"
#include "raysplats/model.hpp"
#include "raysplats/tracer.hpp"
#include "render/bands.hpp"
#include "render/output_check.hpp"
#include "run/mirror_meshes.hpp"
#include "run/model_source.hpp"
#include "scene/morton_order.hpp"
#include "shared_work.hpp"
#include "util/number_text.hpp"
#include "util/output_directory.hpp"
#include "validators.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::string model;
  std::string output;
  std::string lpips;
  std::optional<std::size_t> pictures;
  bool align = false;
  bool overwrite = false;
  DataFlags data;
  TraceSettings trace;
  DeviceFlags device;
};

void run(const Options& options, const GlobalOptions& global) {
  const ModelSource source = find_model(options.model);
  const Gaussians model = in_morton_order(read_model(source.file));
  const Dataset dataset =
      load_dataset(options.data.data, options.data.settings.over(dataset_options(source)));
  const Split split = options.data.chosen_split();
  const std::size_t views = dataset.indices(split).size();
  if (views == 0) throw no_views(options.data);
  if (is_run_folder(options.output)) {
    throw UsageError(fmt::format(
        "The output folder {} is a run, whose metrics.json would be lost: choose another, such as "
        "{}",
        options.output, (std::filesystem::path(options.output) / "eval").string()));
  }
  check_not_data(options.output, dataset);
  if (!options.overwrite) check_outside_data(options.output);
  const std::set<std::string> former = former_pictures(options.output);
  check_leftovers(options.output,
                  replaced_names(former, dataset, split, options.pictures.value_or(views) >= views),
                  FrameFormat::kPng, options.overwrite);
  const TraceOptions trace = options.trace.over(trace_options(source));
  share_work(options.device, global, [&](Communicator& ranks, Context& context) {
    const Model on_device(context, model);
    Tracer tracer(context, trace, mirrors_of(source));
    std::unique_ptr<Lpips> lpips;
    if (!options.lpips.empty()) lpips = std::make_unique<Lpips>(options.lpips);
    make_output_directory(options.output);
    spdlog::info("{} Gaussians of {}, {}", model.size(), source.file.string(),
                 counted(views, "view"));

    FrameProgress progress("evaluating", views, ranks, global.quiet);
    std::uint64_t rays = 0;
    std::uint64_t capped = 0;
    // As frames are: rows of every view where there are fewer than ranks.
    const bool together = !options.align && views < static_cast<std::size_t>(ranks.size());
    if (together) {
      tracer.set_share(static_cast<std::size_t>(ranks.rank()),
                       static_cast<std::size_t>(ranks.size()));
    }
    const auto render = [&](const Camera& camera) {
      Image image = tracer.render(on_device, camera, false,
                                  [&](double share) { return progress.within(share); });
      if (together) {
        if (ranks.all_reduce_or(image.data.empty())) return Image();
        collect_rows(ranks, tracer.rows(), image);
      }
      if (!together || ranks.leads()) rays += image.pixels();
      rays += tracer.reflected_rays();
      capped += tracer.capped_rays();
      return image;
    };
    EvaluationOptions evaluation;
    evaluation.max_pictures = options.pictures;
    evaluation.lpips = lpips.get();
    evaluation.align = options.align;
    evaluation.done = [&](std::size_t done) { return progress.done(done); };
    evaluation.ranks = &ranks;
    evaluation.together = together;
    const EvaluationReport report =
        evaluate(render, dataset, split, trace.background, options.output, evaluation);
    capped = sum_over(ranks, capped);
    rays = sum_over(ranks, rays);
    progress.finish(report.images.size(),
                    "views: the means in " + options.output + " are of those");
    if (!ranks.leads()) return;
    remove_former_pictures(options.output, former, report);
    warn_of_capped_rays(capped, rays, trace);
    fmt::print("{}", report.table());
    if (options.device.profile) fmt::print("{}", context.profile_table());
  });
}

}  // namespace

Command add_eval_command(CLI::App& app, const GlobalOptions& global) {
  CLI::App* command = app.add_subcommand("eval", "Compare a model with the photos of a data set");
  auto options = std::make_shared<Options>();
  add_model_argument(*command, options->model);
  command->add_option("-o,--output", options->output, "Folder for metrics.json and pictures")
      ->required()
      ->check(not_empty())
      ->type_name("DIR");
  command
      ->add_option("--pictures", options->pictures,
                   "Views shown beside their photos at most: worst, median and best, then the "
                   "first ones (all)")
      ->transform(whole_between(0, 1e9))
      ->type_name("N");
  command
      ->add_option("--lpips", options->lpips,
                   "ONNX network of LPIPS (scripts/quality/export_lpips.py), for that measure too")
      ->type_name("NETWORK");
  command->add_flag("--align", options->align,
                    "Also move each camera to where its render comes closest to the photo, and "
                    "measure PSNR there: errors of poses do not count");
  add_overwrite_flag(*command, options->overwrite);
  add_data_flags(*command, options->data)->required();
  add_trace_flags(*command, options->trace);
  add_traversal_flag(*command, options->trace);
  add_device_flags(*command, options->device);
  return {command, [options, &global] { run(*options, global); }};
}

}  // namespace raysplats::cli
