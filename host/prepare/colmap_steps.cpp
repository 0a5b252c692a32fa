// SPDX-License-Identifier: Apache-2.0
#include "prepare/colmap_steps.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>
#include <string_view>

#include "raysplats/error.hpp"
#include "util/atomic_file.hpp"
#include "util/number_text.hpp"
#include "util/progress.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

/// The number behind `before` in a line, 0 when there is none.
std::size_t number_behind(std::string_view line, std::string_view before) {
  const std::size_t at = line.find(before);
  std::size_t value = 0;
  if (at != std::string_view::npos) {
    const char* begin = line.data() + at + before.size();
    std::from_chars(begin, line.data() + line.size(), value);
  }
  return value;
}

bool contains(std::string_view text, std::string_view part) {
  return text.find(part) != std::string_view::npos;
}

/// The photo that a line of COLMAP's mapper is about: "Registering image #12 (15)", or of newer
/// versions "Registering image #12 (num_reg_frames=15)", is the 15th one.
std::size_t placed_photos(std::string_view line) {
  if (!contains(line, "Registering image")) return 0;
  const std::size_t newer = number_behind(line, "num_reg_frames=");
  return newer > 0 ? newer : number_behind(line, "(");
}

/// "Matching block [1/2, 1/2]" or "Processing image [3/9]": newer versions of COLMAP have other
/// words, and the time before them.
bool tells_match(std::string_view line) {
  return contains(line, "block [") || contains(line, "image [");
}

/// The name that an option has by what COLMAP says of its options: about version 3.13 some have
/// left Sift*, one after the other.
std::string option_name(std::string_view help, std::string_view newer, std::string_view older) {
  return std::string(contains(help, newer) ? newer : older);
}

std::string match_settings(const ColmapPlan& plan) { return plan.matcher.front() + "\n"; }

std::string model_settings(const ColmapPlan& plan) {
  return plan.finds_axis ? "mapper, axis\n" : "mapper\n";
}

/// The mapper leaves the axis of each lens in the middle of the picture, and turns all photos by
/// what that is wrong.
void find_axis(const fs::path& models, WorkFolder& work) {
  for (const fs::directory_entry& model : fs::directory_iterator(models)) {
    const std::string folder = model.path().string();
    work.colmap(
        {"bundle_adjuster", "--input_path", folder, "--output_path", folder,
         "--BundleAdjustment.refine_principal_point", "1"},
        "lens", [](std::string_view, std::size_t&) {}, 0);
  }
}

}  // namespace

void tell_time(const ColmapPlan& plan, const WorkFolder& work) {
  ColmapSeconds left = plan.seconds;
  const bool features = work.due("features", plan.feature_settings);
  const bool matches = features || work.due("matches", match_settings(plan));
  if (!features) left.features = 0;
  if (!matches) left.matches = 0;
  if (!matches && !work.due("model", model_settings(plan))) return;
  spdlog::info(
      "COLMAP will take about {} for {} photos, if nothing else runs: features {}, matches {}, "
      "poses {}",
      format_duration(left.features + left.matches + left.poses), plan.photos,
      format_duration(left.features), format_duration(left.matches), format_duration(left.poses));
}

void tell_matching(const PrepareOptions& options, const ColmapPlan& plan, const WorkFolder& work) {
  if (options.matching != Matching::kAuto || plan.photos <= kMostExhaustive) return;
  if (!work.due("features", plan.feature_settings) && !work.due("matches", match_settings(plan)))
    return;
  spdlog::info(
      "more than {} photos: each is compared with the {} that follow it by name, as by --matching "
      "sequential, because every pair would take long; photos in no order need --matching "
      "exhaustive",
      kMostExhaustive, kSequentialOverlap);
}

void find_features(const PrepareOptions& options, const ColmapPlan& plan, WorkFolder& work) {
  work.step("features", plan.feature_settings, [&] {
    fs::remove(work / "database.db");
    const std::string help = work.colmap_help("feature_extractor");
    const std::string use_gpu =
        option_name(help, "--FeatureExtraction.use_gpu", "--SiftExtraction.use_gpu");
    const std::string max_size =
        option_name(help, "--FeatureExtraction.max_image_size", "--SiftExtraction.max_image_size");
    std::size_t before = 0;
    for (const std::vector<std::string>& photos : plan.cameras) {
      // COLMAP shares a camera among all photos that one call is given.
      const fs::path list = work / "prepare/photos.txt";
      write_text_file(list, fmt::format("{}\n", fmt::join(photos, "\n")));
      work.colmap(
          {"feature_extractor", "--database_path", work.text("database.db"), "--image_path",
           work.text("images"), "--image_list_path", list.string(), "--ImageReader.single_camera",
           options.cameras == Cameras::kPhoto ? "0" : "1", "--ImageReader.camera_model",
           options.camera_model, use_gpu, "0", max_size, std::to_string(options.max_size),
           "--SiftExtraction.max_num_features", std::to_string(plan.features)},
          "features",
          [&](std::string_view line, std::size_t& done) {
            done = std::max(done, before + number_behind(line, "Processed file ["));
          },
          plan.photos);
      before += photos.size();
    }
  });
}

void match_photos(const ColmapPlan& plan, WorkFolder& work) {
  work.step("matches", match_settings(plan), [&] {
    const std::string use_gpu = option_name(work.colmap_help(plan.matcher.front()),
                                            "--FeatureMatching.use_gpu", "--SiftMatching.use_gpu");
    std::vector<std::string> arguments = plan.matcher;
    arguments.insert(arguments.end(), {"--database_path", work.text("database.db"), use_gpu, "0"});
    work.colmap(
        arguments, "matches",
        [](std::string_view line, std::size_t& done) {
          if (tells_match(line)) ++done;
        },
        plan.match_lines);
  });
}

void place_photos(const ColmapPlan& plan, WorkFolder& work) {
  work.step("model", model_settings(plan), [&] {
    const fs::path part = work / "sparse.part";
    fs::remove_all(part);
    fs::create_directories(part);
    bool none = false;
    try {
      work.colmap(
          {"mapper", "--database_path", work.text("database.db"), "--image_path",
           work.text("images"), "--output_path", part.string()},
          "poses",
          [&](std::string_view line, std::size_t& done) {
            none = none || contains(line, "failed to create sparse model");
            done = std::max(done, placed_photos(line));
          },
          plan.photos);
    } catch (const Error& error) {
      // Without a model COLMAP ends with an error, as it does for others.
      if (error.code() != ErrorCode::kRuntime || !none) throw;
    }
    if (!fs::exists(part) || fs::is_empty(part)) {
      throw DataError(
          fmt::format("COLMAP found no poses for the {} photos: they have to overlap by more than "
                      "half and to be sharp (what it said is in {})",
                      plan.photos, work.log().string()));
    }
    if (plan.finds_axis) find_axis(part, work);
    fs::remove_all(work / "sparse");
    fs::rename(part, work / "sparse");
  });
}

}  // namespace raysplats
