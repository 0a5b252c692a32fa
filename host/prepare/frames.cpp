// SPDX-License-Identifier: Apache-2.0
#include "prepare/frames.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>

#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "scene/image/sharpness.hpp"
#include "util/file_kind.hpp"
#include "util/number_text.hpp"
#include "util/path_text.hpp"
#include "util/program.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kCandidates = 3;  ///< frames of which the sharpest is kept

/// Hears of every file in a folder and in those folders below it that `enters` takes; folders below
/// that may not be read are passed over. Throws DataError when the folder itself cannot be read.
void each_file(const fs::path& folder,
               const std::function<bool(const fs::path&)>& enters,
               const std::function<void(const fs::path&)>& hear) {
  std::error_code error;
  // The other iterator passes over the outermost folder as well.
  const fs::directory_iterator readable(folder, error);
  fs::recursive_directory_iterator at;
  if (!error) {
    at = fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied,
                                          error);
  }
  for (; !error && at != fs::recursive_directory_iterator(); at.increment(error)) {
    if (is_folder(at->path()) && !enters(at->path())) at.disable_recursion_pending();
    if (is_file(at->path())) hear(at->path());
  }
  if (error)
    throw DataError(fmt::format("{} cannot be read: {}", folder.string(), error.message()));
}

bool is_hidden(const fs::path& path) { return path.filename().string().starts_with('.'); }

DataError no_video(const fs::path& video, const std::string& reason) {
  return DataError(fmt::format("{} is no video that ffmpeg can read{}", video.string(), reason));
}

/// Runs ffprobe with `wanted` for a video; `hear` gets the name and the value of every entry.
void probe(const fs::path& video,
           std::vector<std::string> wanted,
           const fs::path& log,
           const std::function<void(std::string_view, std::string_view)>& hear,
           const std::function<bool()>& stop) {
  wanted.insert(wanted.begin(), {"-v", "error"});
  wanted.insert(wanted.end(), {"-of", "default=noprint_wrappers=1", fs::absolute(video).string()});
  run_program(
      find_program("ffprobe", "ffmpeg"), wanted, log,
      [&](std::string_view line) {
        const std::size_t equals = line.find('=');
        if (equals != std::string_view::npos) hear(line.substr(0, equals), line.substr(equals + 1));
      },
      stop);
}

/// Of "30000/1001"; 0 of "0/0", as files say that do not know.
double ratio(std::string_view text) {
  const std::size_t slash = text.find('/');
  if (slash == std::string_view::npos) return 0.0;
  const std::optional<double> over = parse_real(text.substr(0, slash));
  const std::optional<double> under = parse_real(text.substr(slash + 1));
  return over && under && *under > 0.0 ? *over / *under : 0.0;
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
      [&](std::string_view name, std::string_view value) {
        if (name != "pts_time") return;
        ++packets;
        const std::optional<double> time = parse_real(value);
        if (!time) return;
        // Packets come in the order of decoding, which is not that of their times.
        first = timed == 0 ? *time : std::min(first, *time);
        last = timed == 0 ? *time : std::max(last, *time);
        ++timed;
      },
      stop);
  if (packets == 0) throw no_video(video, "");
  if (!(last > first)) {
    throw DataError(fmt::format(
        "{} states no length: if it is a video, write it anew with 'ffmpeg -i {} -c copy {}'",
        video.string(), video.filename().string(), video.stem().string() + "_anew.mp4"));
  }
  const auto frames = static_cast<double>(timed);
  return (last - first) * frames / (frames - 1.0);  // the last frame lasts as the others do
}

/// A path as a part of ffmpeg's patterns of names, in which a % starts a number.
std::string in_pattern(const fs::path& path) {
  std::string out;
  for (const char c : path.string()) out += c == '%' ? "%%" : std::string(1, c);
  return out;
}

bool same_bytes(const fs::path& a, const fs::path& b) {
  if (fs::file_size(a) != fs::file_size(b)) return false;
  std::ifstream first(a, std::ios::binary);
  std::ifstream second(b, std::ios::binary);
  return std::equal(std::istreambuf_iterator<char>(first), {},
                    std::istreambuf_iterator<char>(second));
}

void warn_of_high_range(const fs::path& video, const std::string& transfer) {
  const bool hlg = transfer == "arib-std-b67";
  if (!hlg && transfer != "smpte2084") return;
  spdlog::warn(
      "{} is an HDR video ({}), whose frames come out in pale colours: record without HDR, or make "
      "an SDR video of it first (docs/cli.md, 'prepare')",
      video.string(), hlg ? "HLG" : "PQ");
}

}  // namespace

bool is_photo(const fs::path& path) {
  const std::string extension = lower_extension(path);
  constexpr std::array<const char*, 7> kKnown{".jpg",  ".jpeg", ".png", ".tif",
                                              ".tiff", ".bmp",  ".webp"};
  return std::find(kKnown.begin(), kKnown.end(), extension) != kKnown.end() &&
         !is_apple_double(path);
}

std::vector<std::string> photos_in(const fs::path& folder) {
  std::vector<std::string> names;
  each_file(
      folder, [](const fs::path&) { return false; },
      [&](const fs::path& file) {
        if (is_photo(file)) names.push_back(file.filename().string());
      });
  std::sort(names.begin(), names.end());
  return names;
}

std::vector<std::string> photos_below(const fs::path& folder, const fs::path& without) {
  std::vector<std::string> names;
  std::error_code error;
  each_file(
      folder,
      [&](const fs::path& below) {
        return !is_hidden(below) && !fs::equivalent(below, without, error);
      },
      [&](const fs::path& file) {
        if (is_photo(file)) names.push_back(file.lexically_relative(folder).generic_string());
      });
  std::sort(names.begin(), names.end());
  return names;
}

std::map<std::string, std::size_t> unread_pictures(const fs::path& folder, bool below) {
  constexpr std::array<const char*, 12> kUnread{".heic", ".heif", ".avif", ".jxl", ".dng", ".cr2",
                                                ".cr3",  ".nef",  ".arw",  ".raf", ".orf", ".rw2"};
  std::map<std::string, std::size_t> out;
  each_file(
      folder, [&](const fs::path& inner) { return below && !is_hidden(inner); },
      [&](const fs::path& file) {
        const std::string extension = lower_extension(file);
        if (std::find(kUnread.begin(), kUnread.end(), extension) != kUnread.end()) ++out[extension];
      });
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

VideoFacts video_facts(const fs::path& video,
                       const fs::path& log,
                       const std::function<bool()>& stop) {
  VideoFacts facts;
  bool pictures = false;
  try {
    probe(
        video,
        {"-select_streams", "v:0", "-show_entries",
         "stream=avg_frame_rate,r_frame_rate,color_transfer:format=duration"},
        log,
        [&](std::string_view name, std::string_view value) {
          if (name == "avg_frame_rate") {
            pictures = true;
            facts.rate = ratio(value);
          }
          if (name == "r_frame_rate") facts.densest_rate = ratio(value);
          if (name == "color_transfer") facts.transfer = value;
          if (name == "duration") facts.seconds = parse_real(value).value_or(0.0);
        },
        stop);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kRuntime) throw;
    throw no_video(video, fmt::format(": {}", error.what()));
  }
  if (!pictures) throw no_video(video, "");
  if (!(facts.seconds > 0.0)) facts.seconds = seconds_of_packets(video, log, stop);
  return facts;
}

void take_frames(const fs::path& video,
                 const VideoFacts& facts,
                 const fs::path& images,
                 std::size_t count,
                 const fs::path& log,
                 const std::function<bool(std::size_t, std::size_t)>& watch) {
  warn_of_high_range(video, facts.transfer);
  // A rate above the video's own repeats frames. That of its densest part, or twice the mean of one
  // that varies little, still meets every frame. (Some files state their clock's, 90 000.)
  constexpr double kMostRate = 240.0;
  double rate = static_cast<double>(kCandidates * count) / facts.seconds;
  if (facts.rate > 0.0)
    rate = std::min(rate, std::max(2.0 * facts.rate, std::min(facts.densest_rate, kMostRate)));
  const auto total = static_cast<std::size_t>(std::lround(rate * facts.seconds));
  const fs::path all = images.parent_path() / "frames.part";
  fs::remove_all(all);
  fs::create_directories(all);
  std::size_t made = 0;
  run_program(
      find_program("ffmpeg", "ffmpeg"),
      {"-nostdin", "-hide_banner", "-v", "error", "-progress", "pipe:1", "-i",
       fs::absolute(video).string(), "-vf",
       // A JPEG does not say by which matrix its colours were made: all readers take BT.601's.
       fmt::format("fps={:.6f},scale=out_color_matrix=bt601:out_range=full", rate), "-q:v", "2",
       in_pattern(fs::absolute(all)) + "/frame_%06d.jpg"},
      log,
      [&](std::string_view line) {
        if (line.starts_with("frame="))
          std::from_chars(line.data() + 6, line.data() + line.size(), made);
      },
      [&] { return !watch(std::min(made, total), 2 * total); });
  std::vector<std::string> names = photos_in(all);
  if (names.empty()) throw DataError(fmt::format("{} has no frames", video.string()));
  // Repeated frames would be the same photo for training and for evaluation.
  names.erase(std::unique(names.begin(), names.end(),
                          [&](const std::string& a, const std::string& b) {
                            return same_bytes(all / a, all / b);
                          }),
              names.end());
  if (names.size() < count) {
    spdlog::info("{} gives {}, not the {} asked for: all are taken", video.string(),
                 counted(static_cast<double>(names.size()), "different frame"), count);
  }
  const std::size_t photos = std::min(count, names.size());
  fs::create_directories(images);
  for (std::size_t photo = 0; photo < photos; ++photo) {
    const std::size_t first = photo * names.size() / photos;
    const std::size_t end = (photo + 1) * names.size() / photos;
    std::size_t best = first;
    double most = -1.0;
    for (std::size_t i = first; i < end; ++i) {
      const double sharp = sharpness(read_image(all / names[i])).fine;
      if (sharp > most) best = i;
      most = std::max(most, sharp);
    }
    fs::rename(all / names[best], images / names[best]);
    if (!watch(total + end * total / names.size(), 2 * total)) {
      throw Error(ErrorCode::kInterrupted,
                  "Interrupted among the frames of the video: the same command starts them anew");
    }
  }
  fs::remove_all(all);
}

}  // namespace raysplats
