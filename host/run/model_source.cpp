// SPDX-License-Identifier: Apache-2.0
#include "run/model_source.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <string>
#include <string_view>
#include <system_error>
#include <tuple>
#include <vector>

#include "io/model/model_file.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "run/train_config.hpp"
#include "scene/gaussians/gaussian_transform.hpp"
#include "util/file_kind.hpp"
#include "util/shell_word.hpp"

namespace raysplats {
namespace {

constexpr std::string_view kIterationPrefix = "iteration_";

std::optional<std::int64_t> iteration_of(const std::filesystem::path& folder) {
  const std::string name = folder.filename().string();
  if (!name.starts_with(kIterationPrefix)) return std::nullopt;
  std::int64_t value = 0;
  const char* end = name.data() + name.size();
  const auto [next, error] = std::from_chars(name.data() + kIterationPrefix.size(), end, value);
  return error == std::errc() && next == end && value >= 0 ? std::optional(value) : std::nullopt;
}

bool holds_sog(const std::filesystem::path& folder) { return io::file_of(folder) != folder; }

std::filesystem::path config_of(const std::filesystem::path& run) { return run / "config.toml"; }

void read_options(ModelSource& source, const std::filesystem::path& run) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(config_of(run), error)) return;
  source.trained.emplace();
  source.config = config_of(run);
  read_train_config(source.config, *source.trained);
}

void read_header(ModelSource& source) {
  if (io::model_format(source.file) == io::ModelFormat::kPly) {
    source.header = read_ply_options(source.file);
    if (source.header) source.sky = source.header->sky;
  }
  source.origin = io::model_origin(source.file);
}

// The sky of a run, which its PLY names.
SkyLight trained_sky(const ModelSource& source) {
  if (source.sky.empty()) {
    spdlog::warn(
        "the sky of the run is not in the header of {}, where the run wrote it: black is shown in "
        "its place",
        source.file.string());
  }
  return source.sky;
}

bool tells(const ModelSource& source) { return source.trained || source.header; }

// Whether two models want other hits, or in another order.
bool hits_differ(const ModelSource& a, const ModelSource& b) {
  const auto hits_of = [](const ModelSource& source) {
    const TraceOptions trace =
        source.trained ? source.trained->trace : source.header.value_or(peak_order());
    return std::tuple(trace.hit_order, trace.quantile, trace.adaptive_radius,
                      trace.min_transmittance, trace.max_hits);
  };
  return hits_of(a) != hits_of(b);
}

// Lays models that count from different origins beside each other as their files have them.
// Nothing is known of those without an origin, nor of any where the scene has none.
void set_offsets(SceneFile& scene,
                 const std::vector<ModelSource>& sources,
                 const std::array<double, 3>& origin) {
  constexpr std::array<double, 3> kNone{};
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const std::array<double, 3>& own = sources[i].origin;
    glm::dvec3& offset = scene.models[i].offset;
    offset = glm::dvec3(0.0);
    if (own == kNone || own == origin) continue;
    if (origin == kNone) {
      spdlog::info("{} counts from {}, the scene from no origin: its numbers are taken as they are",
                   sources[i].file.string(), fmt::join(own, ", "));
      continue;
    }
    offset = glm::dvec3(own[0], own[1], own[2]) - glm::dvec3(origin[0], origin[1], origin[2]);
    spdlog::info("{} counts from {}, the scene from {}: it is moved by {}, {}, {} first",
                 sources[i].file.string(), fmt::join(own, ", "), fmt::join(origin, ", "), offset.x,
                 offset.y, offset.z);
  }
}

// What somebody who named a folder without a run may have meant.
std::string meant(const std::filesystem::path& folder) {
  std::error_code error;
  for (const char* cameras : {"transforms.json", "transforms_train.json", "sparse"}) {
    if (std::filesystem::exists(folder / cameras, error))
      return fmt::format("it is a data set: 'raysplats train {} -o RUN' makes a model of it",
                         shell_word(folder.string()));
  }
  const std::vector<std::string> names = models_in(folder);
  if (names.empty()) return "name a run that has saved a model, or a file";
  return fmt::format("name a file in it, such as {}", fmt::join(names, ", "));
}

}  // namespace

bool is_run_folder(const std::filesystem::path& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(config_of(path), error) ||
         std::filesystem::is_directory(path / "point_cloud", error);
}

bool is_model_folder(const std::filesystem::path& path) {
  return is_run_folder(path) || holds_sog(path);
}

std::vector<std::string> models_in(const std::filesystem::path& folder) {
  constexpr std::array<std::string_view, 5> kModels{".ply", ".spz", ".sog", ".splat", ".glb"};
  constexpr std::size_t kNamed = 3;
  std::error_code error;
  std::vector<std::string> names;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string extension = entry->path().extension().string();
    if (std::find(kModels.begin(), kModels.end(), extension) != kModels.end())
      names.push_back(entry->path().filename().string());
  }
  std::sort(names.begin(), names.end());
  names.resize(std::min(names.size(), kNamed));
  return names;
}

ModelSource find_model(const std::filesystem::path& path) {
  std::error_code error;
  ModelSource source;
  if (!is_there(path)) {
    throw DataError(fmt::format("The model {} does not exist: check the path", path.string()));
  }
  if (!std::filesystem::is_directory(path, error)) {
    source.file = path;
    const std::filesystem::path folder =
        std::filesystem::absolute(path, error).lexically_normal().parent_path();
    source.iteration = iteration_of(folder);
    if (source.iteration && folder.parent_path().filename() == "point_cloud") {
      read_options(source, folder.parent_path().parent_path());
    }
    read_header(source);
    return source;
  }
  if (holds_sog(path) && !is_run_folder(path)) {
    source.file = io::file_of(path);
    return source;
  }
  for (std::filesystem::directory_iterator entry(path / "point_cloud", error), end;
       !error && entry != end; entry.increment(error)) {
    const std::optional<std::int64_t> iteration = iteration_of(entry->path());
    const std::filesystem::path ply = entry->path() / "point_cloud.ply";
    std::error_code ignored;
    if (!iteration || (source.iteration && *iteration <= *source.iteration)) continue;
    if (!std::filesystem::is_regular_file(ply, ignored)) continue;
    source.iteration = iteration;
    source.file = ply;
  }
  if (!source.iteration) {
    throw DataError(
        fmt::format("The folder {} is no run that has saved a model "
                    "(point_cloud/iteration_N/point_cloud.ply): {}",
                    path.string(), meant(path)));
  }
  read_options(source, path);
  read_header(source);
  return source;
}

DatasetOptions dataset_options(const ModelSource& source) {
  DatasetOptions out = source.trained ? source.trained->data : DatasetOptions();
  out.origin = source.origin;
  return out;
}

TraceOptions trace_options(const ModelSource& source) {
  if (!source.trained && source.header) return *source.header;
  if (!source.trained) {
    spdlog::info(
        "{} does not say how it is traced: hits are taken in peak order, as rasterisers do",
        source.file.string());
    return peak_order();
  }
  TraceOptions out = source.trained->trace;
  // The header knows a background that the photos have chosen; a run whose configuration leaves the
  // choice open has photos that are cut out.
  out.background =
      source.header ? source.header->background : background_color(*source.trained, true);
  if (source.trained->background == "sky") out.sky = trained_sky(source);
  return out;
}

void find_models(SceneFile& scene) {
  if (scene.models.empty()) return;
  std::vector<ModelSource> sources;
  for (SceneModel& model : scene.models) {
    sources.push_back(find_model(model.file));
    model.file = sources.back().file;
  }
  const auto telling = std::find_if(sources.begin(), sources.end(), tells);
  const auto first = telling == sources.end() ? sources.begin() : telling;
  scene.trained = trace_options(*first);
  scene.trained.sky = transformed(
      scene.trained.sky, scene.models[static_cast<std::size_t>(first - sources.begin())].transform);
  scene.trained_data = dataset_options(*first);
  set_offsets(scene, sources, first->origin);
  if (std::any_of(sources.begin(), sources.end(),
                  [&](const ModelSource& source) { return hits_differ(source, *first); })) {
    spdlog::info("all models are traced as {} wants it, although others want it otherwise",
                 first->file.string());
  }
}

}  // namespace raysplats
