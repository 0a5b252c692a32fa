// SPDX-License-Identifier: Apache-2.0
#include "prepare/prepare.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <set>
#include <string_view>

#include "io/colmap_model.hpp"
#include "prepare/frames.hpp"
#include "raysplats/error.hpp"
#include "util/atomic_file.hpp"
#include "util/program.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kSequentialOverlap = 12;
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

/// The folder that is made, and which of its steps are done with which settings.
class Work {
 public:
  Work(fs::path data, const PrepareWatch& watch) : data_(std::move(data)), watch_(watch) {
    fs::create_directories(data_ / "prepare");
  }

  /// Runs `action` unless it was done with the same settings, or after a step that was done anew.
  template <class Action>
  void step(const std::string& name, const std::string& settings, Action action) {
    const fs::path mark = data_ / "prepare" / name;
    std::ifstream stream(mark);
    const std::string before((std::istreambuf_iterator<char>(stream)), {});
    if (!anew_ && stream && before == settings) return;
    anew_ = true;
    fs::remove(mark);
    action();
    write_text_file(mark, settings);
  }
  void colmap(const std::vector<std::string>& arguments,
              const std::string& step,
              const std::function<void(std::string_view, std::size_t& done)>& count,
              std::size_t total) {
    std::size_t done = 0;
    run_program(
        find_program("colmap", "colmap"), arguments, log(),
        [&](std::string_view line) { count(line, done); },
        [&] { return !watch_(step, done, total); });
  }
  fs::path operator/(const char* name) const { return data_ / name; }
  std::string text(const char* name) const { return (data_ / name).string(); }
  fs::path log() const { return data_ / "prepare.log"; }
  bool watch(const std::string& step, std::size_t done, std::size_t total) const {
    return watch_(step, done, total);
  }

 private:
  fs::path data_;
  const PrepareWatch& watch_;
  bool anew_ = false;
};

std::vector<std::string> gather_images(const fs::path& input,
                                       const PrepareOptions& options,
                                       Work& work) {
  const bool video = !fs::is_directory(input);
  std::string settings = fs::absolute(input).string() + "\n";
  const std::vector<std::string> given = video ? std::vector<std::string>{} : photos_in(input);
  if (video) settings += fmt::format("{} frames\n", options.frames);
  // Photos that have come, gone or changed since are to be seen.
  for (const std::string& name : given)
    settings += fmt::format("{} {}\n", name, fs::file_size(input / name));
  const fs::path images = work / "images";
  work.step("images", settings, [&] {
    write_text_file(work / "prepare/own", "images and sparse are made by raysplats prepare\n");
    fs::remove_all(images);
    if (video) {
      take_frames(input, images, options.frames, work.log(),
                  [&](std::size_t done, std::size_t of) { return work.watch("frames", done, of); });
      return;
    }
    copy_photos(input, images, given, [&](std::size_t done) {
      if (!work.watch("photos", done, given.size()))
        throw Error(ErrorCode::kInterrupted,
                    "Interrupted among the photos: the same command copies them anew");
    });
  });
  return photos_in(images);
}

void find_features(const PrepareOptions& options, std::size_t photos, bool one_camera, Work& work) {
  work.step("features", fmt::format("{} {}\n", options.camera_model, options.max_size), [&] {
    fs::remove(work / "database.db");
    work.colmap(
        {"feature_extractor", "--database_path", work.text("database.db"), "--image_path",
         work.text("images"), "--ImageReader.single_camera", one_camera ? "1" : "0",
         "--ImageReader.camera_model", options.camera_model, "--SiftExtraction.use_gpu", "0",
         "--SiftExtraction.max_image_size", std::to_string(options.max_size)},
        "features",
        [](std::string_view line, std::size_t& done) {
          done = std::max(done, number_behind(line, "Processed file ["));
        },
        photos);
  });
}

void match(const PrepareOptions& options, std::size_t photos, bool video, Work& work) {
  const bool sequential =
      options.matching == Matching::kSequential ||
      (options.matching == Matching::kAuto && (video || photos > kMostExhaustive));
  work.step("matches", sequential ? "sequential\n" : "exhaustive\n", [&] {
    std::vector<std::string> arguments{sequential ? "sequential_matcher" : "exhaustive_matcher",
                                       "--database_path", work.text("database.db"),
                                       "--SiftMatching.use_gpu", "0"};
    if (sequential) {
      arguments.insert(arguments.end(),
                       {"--SequentialMatching.overlap", std::to_string(kSequentialOverlap)});
    }
    work.colmap(
        arguments, "matches",
        [](std::string_view line, std::size_t& done) {
          if (line.starts_with("Matching ")) ++done;
        },
        0);
  });
}

void place(std::size_t photos, Work& work) {
  work.step("model", "mapper\n", [&] {
    const fs::path part = work / "sparse.part";
    fs::remove_all(part);
    fs::create_directories(part);
    work.colmap(
        {"mapper", "--database_path", work.text("database.db"), "--image_path", work.text("images"),
         "--output_path", part.string()},
        "poses",
        [](std::string_view line, std::size_t& done) {
          // "Registering image #12 (15)": the 15th one.
          if (line.find("Registering image") != std::string_view::npos)
            done = std::max(done, number_behind(line, "("));
        },
        photos);
    if (!fs::exists(part) || fs::is_empty(part)) {
      throw DataError(
          fmt::format("COLMAP found no poses for the {} photos: they have to overlap by more than "
                      "half and to be "
                      "sharp (what it said is in {})",
                      photos, work.log().string()));
    }
    fs::remove_all(work / "sparse");
    fs::rename(part, work / "sparse");
  });
}

}  // namespace

Prepared prepare_data(const fs::path& input,
                      const fs::path& data,
                      const PrepareOptions& options,
                      const PrepareWatch& watch) {
  if (!fs::exists(input))
    throw DataError(
        fmt::format("{} does not exist: name a folder of photos or a video", input.string()));
  const bool video = !fs::is_directory(input);
  find_program("colmap", "colmap");
  if (video) find_program("ffmpeg", "ffmpeg");
  if (!video && photos_in(input).size() < kFewestPhotos) {
    throw DataError(fmt::format("{} holds {} photos, but at least {} are needed", input.string(),
                                photos_in(input).size(), kFewestPhotos));
  }
  std::error_code error;
  if (fs::equivalent(input, data / "images", error))
    throw UsageError(fmt::format("{} is what is read: give another folder with -o", data.string()));
  if (fs::exists(data / "images") && !fs::exists(data / "prepare/own")) {
    throw DataError(
        fmt::format("{} holds images that 'prepare' has not put there: give another folder with -o",
                    data.string()));
  }
  Work work(data, watch);
  const std::vector<std::string> photos = gather_images(input, options, work);
  find_features(options, photos.size(), video, work);
  match(options, photos.size(), video, work);
  place(photos.size(), work);

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
