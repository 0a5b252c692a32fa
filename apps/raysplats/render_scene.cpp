// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <charconv>

#include "frame_progress.hpp"
#include "io/scene/scene_loader.hpp"
#include "raysplats/error.hpp"
#include "raysplats/path_tracer.hpp"
#include "render/output_check.hpp"
#include "render/scene_frames.hpp"
#include "render_flags.hpp"
#include "render_output.hpp"
#include "run/model_source.hpp"
#include "shared_work.hpp"
#include "util/number_text.hpp"
#include "validators.hpp"

namespace raysplats::cli {
namespace {

using Source = SceneCamera::Source;

void check(const RenderFlags& flags) {
  flags.frame_options();
  if (flags.supersample != 1) {
    throw UsageError("--supersample is for models alone: scene files take --samples");
  }
  if (flags.trace.has("near")) {
    throw UsageError(
        "--near is for models alone: rays that leave a mirror have no camera that could be near");
  }
  if (flags.ellipse || flags.spiral || flags.interpolate) {
    throw UsageError(
        "--ellipse, --spiral and --interpolate are for models: give a scene file --path or "
        "--orbit");
  }
  flags.check_path_options();
  const bool data = !flags.data.data.empty();
  const int files = (flags.cameras.empty() ? 0 : 1) + (flags.path.empty() ? 0 : 1);
  if (files > 1 || (files > 0 && (data || flags.orbit))) {
    throw UsageError(
        "--cameras and --path bring their own cameras: give one of them, without --data and "
        "--orbit (which go together)");
  }
  if ((flags.fov || flags.elevation || flags.distance || flags.up) && !flags.orbit) {
    throw UsageError("--fov, --elevation, --distance and --up shape an orbit: add --orbit N");
  }
  flags.data.check_used(flags.orbit.has_value());
}

/// An orbit keeps the lens of the file's camera, which may have no angle.
void check_angle(const RenderFlags& flags, const SceneCamera& camera) {
  if (!flags.fov) return;
  if (camera.model == CameraModel::kEquirectangular) {
    throw UsageError(
        "--fov is for other lenses: the [camera] of this file is equirectangular and shows "
        "everything around");
  }
  if (camera.model == CameraModel::kOrthographic) {
    throw UsageError(
        "--fov is for other lenses: the [camera] of this file is orthographic and has an 'extent'");
  }
}

struct Pace {
  std::optional<double> fps;  ///< of a path
  bool closed = false;        ///< the frame after the last one is the first
};

/// What the command line says goes over what the file says.
Pace override_camera(const RenderFlags& flags, SceneFile& scene) {
  Pace pace;
  SceneCamera& camera = scene.camera;
  scene.width = flags.width;
  scene.height = flags.height;
  const bool data = !flags.data.data.empty();
  if (flags.orbit) {
    if (camera.source != Source::kOrbit) {
      // The lens and up of the file's camera stay, its place does not.
      camera.target.reset();
      camera.file.clear();
      camera.views.clear();
    }
    camera.source = Source::kOrbit;
    camera.frames = *flags.orbit;
    if (flags.fov) {
      camera.fov = *flags.fov;
      camera.focal.reset();
    }
    if (flags.elevation) camera.elevation = *flags.elevation;
    if (flags.distance) camera.distance = *flags.distance;
    if (flags.up) {
      const std::array<double, 3> up = parse_triple(*flags.up);
      camera.up = glm::dvec3(up[0], up[1], up[2]);
    }
    scene.frames.reset();
  }
  if (data) {
    if (!flags.orbit) {
      camera = {};
      camera.source = Source::kData;
    }
    camera.file = flags.data.data;
    camera.split = flags.data.chosen_split();
    camera.data_settings = flags.data.settings;
  } else if (!flags.path.empty()) {
    CameraPathFile path = read_path(flags);
    camera = {};
    camera.source = Source::kGiven;
    camera.given = std::move(path.cameras);
    scene.width = scene.height = std::nullopt;  // they have it already
    // One frame for each, unless the file's animation is longer or shorter.
    if (!scene.frames) scene.frames = static_cast<int>(camera.given.size());
    pace = {path.fps, path.closed};
  } else if (!flags.cameras.empty()) {
    camera = {};
    camera.source = Source::kFile;
    camera.file = flags.cameras;
  }
  if (data || camera.source == Source::kFile) camera.place = scene.path.string();
  if (!data) scene.downscale = flags.data.settings.over({}).factor();
  pace.closed |= camera.source == Source::kOrbit;
  return pace;
}

/// "START:END" as a range within `count` frames.
std::pair<std::size_t, std::size_t> parse_frames(const std::string& text, std::size_t count) {
  if (text.empty()) return {0, count};
  const std::size_t colon = text.find(':');
  const auto number = [&](const std::string& part, std::size_t& target) {
    if (part.empty()) return true;
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), target);
    return error == std::errc() && end == part.data() + part.size();
  };
  std::size_t first = 0;
  std::size_t last = count;
  if (colon == std::string::npos || !number(text.substr(0, colon), first) ||
      !number(text.substr(colon + 1), last)) {
    throw UsageError(fmt::format("--frames '{}' is not START:END, as in 0:10, 10: or :10", text));
  }
  last = std::min(last, count);
  if (first >= last) {
    throw UsageError(
        fmt::format("--frames '{}' holds none of the {} frames of the scene", text, count));
  }
  return {first, last};
}

void print_summary(const SceneReport& report, const std::string& output, double compiling) {
  const auto millions = [&](std::uint64_t rays) {
    return 1e-6 * static_cast<double>(rays) / report.trace_seconds;
  };
  const std::string speed = fmt::format(
      "{:.2f} s of tracing; million rays per second: {:.2f} camera, {:.2f} continued, {:.2f} "
      "shadow",
      report.trace_seconds, millions(report.rays.camera_rays), millions(report.rays.continued_rays),
      millions(report.rays.shadow_rays));
  fmt::print("{} in {} ({})\n", counted(report.frames, "frame"), output,
             with_compiling(speed, compiling));
}

std::string contents(const Scene& scene, std::size_t frames) {
  return fmt::format("{}, {}, {}, {}", counted(scene.gaussians.size(), "Gaussian"),
                     counted(scene.meshes.size(), "mesh", "meshes"),
                     counted(scene.lights.size(), "light"), counted(frames, "frame"));
}

// All ranks: the report of all.
void add_up(Communicator& ranks, SceneReport& report) {
  report.frames = sum_over(ranks, report.frames);
  report.trace_seconds = most_of(ranks, report.trace_seconds);
  PathTracer::Statistics& rays = report.rays;
  for (std::uint64_t* count : {&rays.camera_rays, &rays.continued_rays, &rays.shadow_rays,
                               &rays.capped_rays, &rays.ended_by_bounces})
    *count = sum_over(ranks, *count);
}

}  // namespace

void render_scene(const RenderFlags& flags, const GlobalOptions& global) {
  check(flags);
  SceneFile file = read_scene_file(flags.model);
  find_models(file);
  check_angle(flags, file.camera);
  const Pace pace = override_camera(flags, file);
  file.trained = flags.trace.over(file.trace.over(file.trained));
  file.trace = {};
  file.render = flags.render.over(file.render);
  const LoadedScene loaded = load_scene(file);
  const auto [first, last] = parse_frames(flags.frames, loaded.cameras.size());
  if (!file.camera.file.empty() && !flags.output.empty())
    check_not_data(flags.output, file.camera.file);
  RenderOutput output(flags, loaded.cameras, last - first, pace.fps, pace.closed);

  share_work(flags.device, global,
             [&, first = first, last = last](Communicator& ranks, Context& context) {
               PathTracer tracer(context, loaded.scene);
               FrameProgress progress("rendering", last - first, ranks, global.quiet);
               output.begin(ranks);
               const FrameOptions share = share_of(ranks, output.options(), last - first);
               spdlog::info("{}: {}", flags.model, contents(loaded.scene, last - first));

               SceneReport report = write_scene_frames(
                   tracer, loaded, first, last, flags.output, share,
                   [&](std::size_t done) { return progress.done(done); },
                   [&](double share) { return progress.within(share); });
               add_up(ranks, report);
               progress.finish(report.frames, output.left());
               if (!ranks.leads()) return;
               output.finish();
               const PathTracer::Statistics& rays = report.rays;
               warn_of_capped_rays(rays.capped_rays,
                                   rays.camera_rays + rays.continued_rays + rays.shadow_rays,
                                   loaded.scene.trace);
               tell_of_ended_paths(rays.ended_by_bounces, rays.camera_rays,
                                   loaded.scene.render.max_bounces);
               print_summary(report, output.name(), context.build_seconds());
               if (flags.device.profile) fmt::print("{}", context.profile_table());
             });
}

}  // namespace raysplats::cli
