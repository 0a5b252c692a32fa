// SPDX-License-Identifier: Apache-2.0
#include "prepare/prepare.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <string_view>

#include "io/colmap_model.hpp"
#include "prepare/colmap_plan.hpp"
#include "prepare/frames.hpp"
#include "raysplats/error.hpp"
#include "util/atomic_file.hpp"
#include "util/file_kind.hpp"
#include "util/file_lock.hpp"
#include "util/number_text.hpp"
#include "util/output_directory.hpp"
#include "util/program.hpp"
#include "util/progress.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kFewestPhotos = 3;

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

/// A file as it is now: one that has changed since has another size or time.
std::string state_of(const fs::path& file) {
  return fmt::format("{} {}", fs::file_size(file),
                     fs::last_write_time(file).time_since_epoch().count());
}

/// A path in one spelling: whole, without links and a separator at its end.
std::string place_of(const fs::path& path) {
  std::error_code error;
  fs::path place = fs::weakly_canonical(fs::absolute(path), error);
  if (error) place = fs::absolute(path).lexically_normal();
  return (place.has_filename() ? place : place.parent_path()).string();
}

/// The file of a step that is done, which holds its settings.
fs::path mark_of(const fs::path& data, const std::string& step) { return data / "prepare" / step; }

/// What the mark of the images says that they were made from, in the spelling of then; empty
/// without a mark.
std::string former_input(const fs::path& data, const fs::path& input) {
  std::ifstream stream(mark_of(data, "images"));
  const std::string text((std::istreambuf_iterator<char>(stream)), {});
  const std::string place = place_of(input);
  return text.starts_with(place + "\n") ? place : text.substr(0, text.find('\n'));
}

/// Each is made from those before it.
constexpr std::array<const char*, 4> kSteps{"images", "features", "matches", "model"};

/// The folder that is made, which no other run writes to meanwhile, and which of its steps are done
/// with which settings.
class Work {
 public:
  Work(const fs::path& data, const PrepareWatch& watch)
      : data_(made(data)), lock_(data_ / ".lock"), watch_(watch) {
    make_output_directory(data_ / "prepare");
  }

  /// Whether a step is still to be done with these settings.
  bool due(const std::string& name, const std::string& settings) const {
    std::ifstream stream(mark_of(data_, name));
    const std::string before((std::istreambuf_iterator<char>(stream)), {});
    return !stream || before != settings;
  }
  /// Runs `action` if the step is due, and makes all later steps due.
  template <class Action>
  void step(const std::string& name, const std::string& settings, Action action) {
    if (!due(name, settings)) return;
    forget(name);
    action();
    write_text_file(mark_of(data_, name), settings);
  }
  /// Makes a step due and all later ones, even when this run ends before it comes to them.
  void forget(const std::string& name) const {
    const auto from = std::find(kSteps.begin(), kSteps.end(), name);
    std::for_each(from, kSteps.end(), [&](const char* step) { fs::remove(mark_of(data_, step)); });
  }
  void colmap(const std::vector<std::string>& arguments,
              const std::string& step,
              const std::function<void(std::string_view, std::size_t& done)>& count,
              std::size_t total) {
    std::size_t done = 0;
    std::string trouble;
    run_program(
        find_program("colmap", "colmap"), arguments, log(),
        [&](std::string_view line) {
          if (trouble.empty() && contains(line, "SQLite error")) trouble = line;
          count(line, done);
        },
        [&] { return !watch_(step, done, total); });
    // COLMAP 3.8 goes on without what its database could not take, as on a full disk.
    if (!trouble.empty()) {
      throw Error(ErrorCode::kRuntime,
                  fmt::format("The database of colmap could not be written: {} (all it said is in "
                              "{})",
                              trouble, log().string()));
    }
  }
  /// What COLMAP says of the options of a command.
  std::string colmap_help(const std::string& command) const {
    std::string text;
    try {
      run_program(find_program("colmap", "colmap"), {command, "-h"}, log(),
                  [&](std::string_view line) { text.append(line) += '\n'; }, {});
    } catch (const Error&) {
      // Some versions end with an error after it; what else is wrong the command itself will say.
    }
    return text;
  }
  const fs::path& data() const { return data_; }
  fs::path operator/(const char* name) const { return data_ / name; }
  std::string text(const char* name) const { return (data_ / name).string(); }
  fs::path log() const { return data_ / "prepare.log"; }
  bool watch(const std::string& step, std::size_t done, std::size_t total) const {
    return watch_(step, done, total);
  }

 private:
  static fs::path made(const fs::path& data) {
    make_output_directory(data);
    return data;
  }

  fs::path data_;
  FileLock lock_;
  const PrepareWatch& watch_;
};

std::vector<std::string> lines_of(const fs::path& file) {
  std::ifstream stream(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// Removes the images that are to be made anew, and before them the poses of what they showed;
/// check_output() has let in nobody else's.
void remove_former(const Work& work) {
  fs::remove_all(work / "sparse");
  fs::remove_all(work / "images");
}

std::vector<std::string> gather_images(const fs::path& input,
                                       const std::vector<std::string>& given,
                                       const PrepareOptions& options,
                                       Work& work) {
  const bool video = !is_folder(input);
  const fs::path images = work / "images";
  // The names of a video's frames, which are known once they are taken, and which data sets of
  // older versions do not list.
  const fs::path frames = work / "prepare/frames";
  const auto taken = [&] { return is_file(frames) ? lines_of(frames) : photos_in(images); };
  const std::vector<std::string> before = video && is_folder(images) ? taken() : given;
  const bool whole = !before.empty() &&
                     std::all_of(before.begin(), before.end(),
                                 [&](const std::string& name) { return is_file(images / name); });
  if (!whole) work.forget("images");
  const std::string former = former_input(work.data(), input);
  std::string settings = (former.empty() ? place_of(input) : former) + "\n";
  // A video and photos that have come, gone or changed since are to be seen.
  if (video) settings += fmt::format("{} frames\n{}\n", options.frames, state_of(input));
  for (const std::string& name : given)
    settings += fmt::format("{} {}\n", name, state_of(input / name));
  work.step("images", settings, [&] {
    write_text_file(work / "prepare/own", "images and sparse are made by raysplats prepare\n");
    if (video) {
      const VideoFacts facts =
          video_facts(input, work.log(), [&] { return !work.watch("video", 0, 0); });
      remove_former(work);
      take_frames(input, facts, images, options.frames, work.log(),
                  [&](std::size_t done, std::size_t of) { return work.watch("frames", done, of); });
      write_text_file(frames, fmt::format("{}\n", fmt::join(photos_in(images), "\n")));
      return;
    }
    remove_former(work);
    copy_photos(input, images, given, [&](std::size_t done) {
      if (!work.watch("photos", done, given.size()))
        throw Error(ErrorCode::kInterrupted,
                    "Interrupted among the photos: the same command copies them anew");
    });
  });
  if (video && !is_file(frames))
    write_text_file(frames, fmt::format("{}\n", fmt::join(photos_in(images), "\n")));
  return video ? lines_of(frames) : given;
}

std::string model_settings(const ColmapPlan& plan) {
  return plan.finds_axis ? "mapper, axis\n" : "mapper\n";
}

/// How long the steps that are due will take.
void tell_time(const ColmapPlan& plan, const Work& work) {
  ColmapSeconds left = plan.seconds;
  const bool features = work.due("features", plan.feature_settings);
  const bool matches = features || work.due("matches", plan.matcher.front() + "\n");
  if (!features) left.features = 0;
  if (!matches) left.matches = 0;
  if (!matches && !work.due("model", model_settings(plan))) return;
  spdlog::info(
      "COLMAP will take about {} for {} photos, if nothing else runs: features {}, matches {}, "
      "poses {}",
      format_duration(left.features + left.matches + left.poses), plan.photos,
      format_duration(left.features), format_duration(left.matches), format_duration(left.poses));
}

/// Which photos are compared, where nobody has said it and the number of photos decides.
void tell_matching(const PrepareOptions& options, const ColmapPlan& plan, const Work& work) {
  if (options.matching != Matching::kAuto || plan.photos <= kMostExhaustive) return;
  if (!work.due("features", plan.feature_settings) &&
      !work.due("matches", plan.matcher.front() + "\n"))
    return;
  spdlog::info(
      "more than {} photos: each is compared with the {} that follow it by name, as by --matching "
      "sequential, because every pair would take long; photos in no order need --matching "
      "exhaustive",
      kMostExhaustive, kSequentialOverlap);
}

void find_features(const PrepareOptions& options, const ColmapPlan& plan, Work& work) {
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

void match(const ColmapPlan& plan, Work& work) {
  work.step("matches", plan.matcher.front() + "\n", [&] {
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

/// The mapper leaves the axis of each lens in the middle of the picture, and turns all photos by
/// what that is wrong.
void find_axis(const fs::path& models, Work& work) {
  for (const fs::directory_entry& model : fs::directory_iterator(models)) {
    const std::string folder = model.path().string();
    work.colmap(
        {"bundle_adjuster", "--input_path", folder, "--output_path", folder,
         "--BundleAdjustment.refine_principal_point", "1"},
        "lens", [](std::string_view, std::size_t&) {}, 0);
  }
}

void place(const ColmapPlan& plan, Work& work) {
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

/// The photos to take. Folders below may hold the same photos at other sizes, or masks: theirs are
/// taken where that is wished, and else it is said that they are there.
std::vector<std::string> chosen_photos(const fs::path& input,
                                       const fs::path& data,
                                       const PrepareOptions& options) {
  const std::vector<std::string> all = photos_below(input, data);
  std::vector<std::string> chosen = options.subfolders ? all : photos_in(input);
  const bool enough = chosen.size() >= kFewestPhotos;
  std::map<std::string, std::size_t> left_out;
  for (const std::string& name : all) {
    const fs::path folder = fs::path(name).parent_path();
    if (!options.subfolders && !folder.empty()) ++left_out[folder.string()];
  }
  std::string below;
  for (const auto& [folder, count] : left_out)
    below += fmt::format("{}{} ({})", below.empty() ? "" : ", ", folder, count);
  std::string unread;
  for (const auto& [extension, count] : unread_pictures(input, options.subfolders))
    unread += fmt::format("{}{} {}", unread.empty() ? "" : ", ", count, extension);
  if (enough && !below.empty())
    spdlog::info("photos in folders below are left out: {}; --subfolders takes them too", below);
  if (enough && !unread.empty())
    spdlog::warn("pictures in formats that are not read are left out: {}; convert them to JPEG",
                 unread);
  if (enough) return chosen;
  throw DataError(fmt::format(
      "{} holds {}, but at least {} are needed{}{}", input.string(),
      counted(chosen.size(), "photo"), kFewestPhotos,
      unread.empty() ? ""
                     : fmt::format("; it has pictures in formats that are not read ({}): convert "
                                   "them to JPEG",
                                   unread),
      below.empty() ? ""
                    : fmt::format("; folders below it hold some: {}: name one of them, or take all "
                                  "with --subfolders",
                                  below)));
}

/// Refuses a folder that belongs to something else: photos that are read, what was made from other
/// photos, or images, models and cameras of somebody else that would be removed or taken for those
/// that are made here.
void check_output(const fs::path& input, const fs::path& data) {
  std::error_code error;
  if (fs::equivalent(input, data / "images", error) || fs::equivalent(input, data, error))
    throw UsageError(fmt::format("{} is what is read: give another folder with -o", data.string()));
  if (fs::exists(data / "prepare/own", error)) {
    const std::string former = former_input(data, input);
    if (former.empty() || place_of(former) == place_of(input)) return;
    throw DataError(fmt::format("{} was made from {}: give another folder with -o, or remove it",
                                data.string(), former));
  }
  for (const char* name : {"images", "sparse", "database.db", "transforms.json",
                           "transforms_train.json", "transforms_test.json"}) {
    if (!fs::exists(data / name, error)) continue;
    throw DataError(
        fmt::format("{} holds {} that 'prepare' has not put there: give another folder with -o",
                    data.string(), name));
  }
}

}  // namespace

Prepared prepare_data(const fs::path& input,
                      const fs::path& data,
                      const PrepareOptions& options,
                      const PrepareWatch& watch) {
  if (!is_there(input))
    throw DataError(
        fmt::format("{} does not exist: name a folder of photos or a video", input.string()));
  const bool video = !is_folder(input);
  if (video && is_photo(input))
    throw DataError(fmt::format("{} is a photo: name its folder", input.string()));
  find_program("colmap", "colmap");
  if (video) find_program("ffmpeg", "ffmpeg");
  const std::vector<std::string> given =
      video ? std::vector<std::string>{} : chosen_photos(input, data, options);
  check_output(input, data);
  ColmapPlan plan;
  // A photo that is none is told by its own name, and before anything is removed.
  if (!video) plan = plan_colmap(input, given, options, video);
  Work work(data, watch);
  const std::vector<std::string> photos = gather_images(input, given, options, work);
  if (video) plan = plan_colmap(work / "images", photos, options, video);
  if (!video) tell_matching(options, plan, work);
  tell_time(plan, work);
  find_features(options, plan, work);
  match(plan, work);
  place(plan, work);

  const std::optional<fs::path> folder = io::find_colmap_model(data);
  if (!folder) throw DataError(fmt::format("{} holds no model of COLMAP", data.string()));
  const io::ColmapModel model = io::read_colmap_model(*folder);
  std::set<std::string> placed;
  for (const io::ColmapImage& image : model.images) placed.insert(image.name);
  Prepared out;
  out.photos = photos.size();
  out.points = model.points.size();
  std::copy_if(photos.begin(), photos.end(), std::back_inserter(out.without_pose),
               [&](const std::string& name) { return !placed.contains(name); });
  return out;
}

}  // namespace raysplats
