// SPDX-License-Identifier: Apache-2.0
#include "prepare/frames.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "scene/sharpness.hpp"
#include "util/file_kind.hpp"
#include "util/number_text.hpp"
#include "util/path_text.hpp"
#include "util/program.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kCandidates = 3;  ///< frames of which the sharpest is kept

bool is_photo(const fs::path& path) {
  const std::string extension = lower_extension(path);
  constexpr std::array<const char*, 7> kKnown{".jpg",  ".jpeg", ".png", ".tif",
                                              ".tiff", ".bmp",  ".webp"};
  return std::find(kKnown.begin(), kKnown.end(), extension) != kKnown.end() &&
         !is_apple_double(path);
}

/// Runs ffprobe with `wanted` for a video; `hear` gets every line.
void probe(const fs::path& video,
           std::vector<std::string> wanted,
           const fs::path& log,
           const std::function<void(std::string_view)>& hear,
           const std::function<bool()>& stop) {
  wanted.insert(wanted.begin(), {"-v", "error"});
  wanted.insert(wanted.end(),
                {"-of", "default=noprint_wrappers=1:nokey=1", fs::absolute(video).string()});
  run_program(find_program("ffprobe", "ffmpeg"), wanted, log, hear, stop);
}

/// By the times of its packets, for files that state no length, as browsers record them.
double seconds_of_packets(const fs::path& video,
                          const fs::path& log,
                          const std::function<bool()>& stop) {
  std::size_t packets = 0;
  std::size_t timed = 0;
  double first = 0.0;
  double last = 0.0;
  probe(
      video, {"-select_streams", "v:0", "-show_entries", "packet=pts_time"}, log,
      [&](std::string_view line) {
        ++packets;
        const std::optional<double> time = parse_real(line);
        if (!time) return;
        // Packets come in the order of decoding, which is not that of their times.
        first = timed == 0 ? *time : std::min(first, *time);
        last = timed == 0 ? *time : std::max(last, *time);
        ++timed;
      },
      stop);
  if (packets == 0)
    throw DataError(fmt::format("{} is no video that ffmpeg can read", video.string()));
  if (!(last > first)) {
    throw DataError(fmt::format(
        "{} states no length: if it is a video, write it anew with 'ffmpeg -i {} -c copy {}'",
        video.string(), video.filename().string(), video.stem().string() + "_anew.mp4"));
  }
  const auto frames = static_cast<double>(timed);
  return (last - first) * frames / (frames - 1.0);  // the last frame lasts as the others do
}

double seconds_of(const fs::path& video, const fs::path& log, const std::function<bool()>& stop) {
  std::optional<double> stated;
  probe(
      video, {"-show_entries", "format=duration"}, log,
      [&](std::string_view line) {
        if (const std::optional<double> seconds = parse_real(line)) stated = seconds;
      },
      stop);
  return stated && *stated > 0.0 ? *stated : seconds_of_packets(video, log, stop);
}

/// A path as a part of ffmpeg's patterns of names, in which a % starts a number.
std::string in_pattern(const fs::path& path) {
  std::string out;
  for (const char c : path.string()) out += c == '%' ? "%%" : std::string(1, c);
  return out;
}

}  // namespace

std::vector<std::string> photos_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && is_photo(entry.path()))
      names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::vector<std::string> photos_below(const fs::path& folder, const fs::path& without) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::recursive_directory_iterator at(folder), end; at != end; ++at) {
    const bool left_out =
        at->path().filename().string().starts_with('.') || fs::equivalent(*at, without, error);
    if (at->is_directory() && left_out) at.disable_recursion_pending();
    if (at->is_regular_file() && is_photo(at->path()))
      names.push_back(at->path().lexically_relative(folder).generic_string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::map<std::string, std::size_t> unread_pictures(const fs::path& folder, bool below) {
  constexpr std::array<const char*, 12> kUnread{".heic", ".heif", ".avif", ".jxl", ".dng", ".cr2",
                                                ".cr3",  ".nef",  ".arw",  ".raf", ".orf", ".rw2"};
  std::map<std::string, std::size_t> out;
  std::error_code error;
  for (fs::recursive_directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error)) {
    std::error_code ignored;
    const bool hidden = at->path().filename().string().starts_with('.');
    if (at->is_directory(ignored) && (!below || hidden)) at.disable_recursion_pending();
    const std::string extension = lower_extension(at->path());
    if (at->is_regular_file(ignored) &&
        std::find(kUnread.begin(), kUnread.end(), extension) != kUnread.end())
      ++out[extension];
  }
  return out;
}

void copy_photos(const fs::path& from,
                 const fs::path& to,
                 const std::vector<std::string>& names,
                 const std::function<void(std::size_t)>& done) {
  fs::create_directories(to);
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::error_code error;
    fs::create_directories((to / names[i]).parent_path(), error);
    if (!error) fs::copy_file(from / names[i], to / names[i], error);
    if (error) {
      throw DataError(fmt::format("{} cannot be copied to {}: {}", (from / names[i]).string(),
                                  to.string(), error.message()));
    }
    done(i + 1);
  }
}

void take_frames(const fs::path& video,
                 const fs::path& images,
                 std::size_t count,
                 const fs::path& log,
                 const std::function<bool(std::size_t, std::size_t)>& watch) {
  const std::size_t total = kCandidates * count;
  const fs::path ffmpeg = find_program("ffmpeg", "ffmpeg");
  const double seconds = seconds_of(video, log, [&] { return !watch(0, total); });
  const fs::path all = images.parent_path() / "frames.part";
  fs::remove_all(all);
  fs::create_directories(all);
  std::size_t made = 0;
  run_program(
      ffmpeg,
      {"-nostdin", "-hide_banner", "-v", "error", "-progress", "pipe:1", "-i",
       fs::absolute(video).string(), "-vf",
       // A JPEG does not say by which matrix its colours were made: all readers take BT.601's.
       fmt::format("fps={:.6f},scale=out_color_matrix=bt601:out_range=full",
                   static_cast<double>(total) / seconds),
       "-q:v", "2", in_pattern(fs::absolute(all)) + "/frame_%06d.jpg"},
      log,
      [&](std::string_view line) {
        if (line.starts_with("frame="))
          std::from_chars(line.data() + 6, line.data() + line.size(), made);
      },
      [&] { return !watch(std::min(made, total), total); });
  const std::vector<std::string> names = photos_in(all);
  if (names.empty()) throw DataError(fmt::format("{} has no frames", video.string()));
  fs::create_directories(images);
  for (std::size_t first = 0; first < names.size(); first += kCandidates) {
    std::size_t best = first;
    double most = -1.0;
    for (std::size_t i = first; i < std::min(first + kCandidates, names.size()); ++i) {
      const double sharp = sharpness(read_image(all / names[i]));
      if (sharp > most) best = i;
      most = std::max(most, sharp);
    }
    fs::rename(all / names[best], images / names[best]);
    if (!watch(first, names.size())) {
      throw Error(ErrorCode::kInterrupted,
                  "Interrupted among the frames of the video: the same command starts them anew");
    }
  }
  fs::remove_all(all);
}

}  // namespace raysplats
