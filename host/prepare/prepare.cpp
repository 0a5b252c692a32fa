// SPDX-License-Identifier: Apache-2.0
#include "prepare/prepare.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <set>

#include "io/dataset/colmap_model.hpp"
#include "prepare/colmap_plan.hpp"
#include "prepare/colmap_steps.hpp"
#include "prepare/frames.hpp"
#include "prepare/work_folder.hpp"
#include "raysplats/error.hpp"
#include "util/atomic_file.hpp"
#include "util/file_kind.hpp"
#include "util/number_text.hpp"
#include "util/program.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kFewestPhotos = 3;

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

/// What the mark of the images says that they were made from, in the spelling of then; empty
/// without a mark.
std::string former_input(const fs::path& data, const fs::path& input) {
  std::ifstream stream(mark_of(data, "images"));
  const std::string text((std::istreambuf_iterator<char>(stream)), {});
  const std::string place = place_of(input);
  return text.starts_with(place + "\n") ? place : text.substr(0, text.find('\n'));
}

std::vector<std::string> lines_of(const fs::path& file) {
  std::ifstream stream(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// Removes the images that are to be made anew, and before them the poses of what they showed;
/// check_output() has let in nobody else's.
void remove_former(const WorkFolder& work) {
  fs::remove_all(work / "sparse");
  fs::remove_all(work / "images");
}

std::vector<std::string> gather_images(const fs::path& input,
                                       const std::vector<std::string>& given,
                                       const PrepareOptions& options,
                                       WorkFolder& work) {
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
  WorkFolder work(data, watch);
  const std::vector<std::string> photos = gather_images(input, given, options, work);
  if (video) plan = plan_colmap(work / "images", photos, options, video);
  if (!video) tell_matching(options, plan, work);
  tell_time(plan, work);
  find_features(options, plan, work);
  match_photos(plan, work);
  place_photos(plan, work);

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
