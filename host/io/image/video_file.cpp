// SPDX-License-Identifier: Apache-2.0
#include "io/image/video_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "io/image/gif_delays.hpp"
#include "io/image/image_codec.hpp"
#include "io/image/video_frame.hpp"
#include "raysplats/error.hpp"
#include "util/atomic_file.hpp"
#include "util/program.hpp"

namespace raysplats {
namespace {

constexpr double kMostFps = 1000.0;

/// What ffmpeg does with the frames. Both formats keep colours at half the resolution, for which
/// sizes have to be even: the last row and column go.
std::vector<std::string> arguments_of(const std::string& extension,
                                      const std::filesystem::path& target,
                                      const FrameSize& size,
                                      double fps) {
  std::vector<std::string> words{"-hide_banner", "-loglevel", "error", "-y"};
  const auto add = [&](std::initializer_list<std::string> more) {
    words.insert(words.end(), more);
  };
  add({"-f", "rawvideo", "-pix_fmt", "rgb24", "-s", fmt::format("{}x{}", size.width, size.height)});
  add({"-r", fmt::format("{}", fps), "-i", "-", "-an"});
  add({"-vf", "crop=trunc(iw/2)*2:trunc(ih/2)*2,scale=out_color_matrix=bt709"});
  if (extension == ".mp4") {
    add({"-c:v", "libx264", "-crf", "18", "-preset", "slow", "-movflags", "+faststart"});
  } else {
    add({"-c:v", "libvpx-vp9", "-b:v", "0", "-crf", "30", "-row-mt", "1"});
  }
  add({"-pix_fmt", "yuv420p", "-color_primaries", "bt709", "-color_trc", "bt709", "-colorspace",
       // A name that begins at the root is neither an option nor an address to ffmpeg.
       "bt709", std::filesystem::absolute(target).string()});
  return words;
}

class EncodedVideo : public VideoFile {
 public:
  EncodedVideo(const std::filesystem::path& path, const VideoOptions& options)
      : path_(path), file_(path), fps_(options.fps), ffmpeg_(find_program("ffmpeg", "ffmpeg")) {}

  void add(const Image& frame) override {
    size_.require(frame, path_);
    if (std::min(frame.width, frame.height) < 2) {
      throw UsageError(fmt::format("The video {} would have {} x {} pixels: use 2 x 2 or more",
                                   path_.string(), frame.width, frame.height));
    }
    if (!input_) {
      input_.emplace(ffmpeg_,
                     arguments_of(path_.extension().string(), file_.temporary(), size_, fps_));
    }
    const std::vector<std::uint8_t> bytes = rgb_bytes(frame);
    input_->write(std::as_bytes(std::span(bytes)));
  }
  void finish() override {
    if (!input_) throw UsageError(fmt::format("The video {} has no frames", path_.string()));
    input_->finish();
    file_.commit();
  }

 private:
  std::filesystem::path path_;
  AtomicFile file_;
  double fps_;
  std::filesystem::path ffmpeg_;
  FrameSize size_;
  std::optional<ProgramInput> input_;  // after the file, so that it ends before that goes
};

class Gif : public VideoFile {
 public:
  Gif(const std::filesystem::path& path, const VideoOptions& options)
      : path_(path), file_(path), fps_(options.fps) {}

  void add(const Image& frame) override {
    size_.require(frame, path_);
    if (!encoder_) {
      encoder_ = io::image_codec().open_gif(file_.temporary(), frame.width, frame.height, fps_);
    }
    encoder_->add(frame);
    ++frames_;
  }
  void finish() override {
    if (!encoder_) throw UsageError(fmt::format("The video {} has no frames", path_.string()));
    encoder_->finish();
    io::set_gif_delays(file_.temporary(), path_, frames_, fps_);
    file_.commit();
  }

 private:
  std::filesystem::path path_;
  AtomicFile file_;
  double fps_;
  FrameSize size_;
  std::size_t frames_ = 0;
  std::unique_ptr<io::MovieEncoder> encoder_;
};

}  // namespace

std::unique_ptr<VideoFile> open_video(const std::filesystem::path& path,
                                      const VideoOptions& options) {
  const std::string extension = path.extension().string();
  const bool gif = extension == ".gif";
  if (!gif && extension != ".apng" && extension != ".mp4" && extension != ".webm") {
    throw UsageError(
        fmt::format("The video {} has no name that says its format: use .mp4, .webm, .gif or .apng",
                    path.string()));
  }
  const double most = gif ? io::kMostGifFps : kMostFps;
  const double least = gif ? io::kLeastGifFps : extension == ".apng" ? kLeastApngFps : 0.0;
  if (!(options.fps > 0.0 && options.fps >= least && options.fps <= most)) {
    throw UsageError(fmt::format("{} frames a second are out of range for {}: use {}up to {}",
                                 options.fps, path.string(),
                                 least > 0.0 ? fmt::format("{:.4g} or more, ", least) : "", most));
  }
  if (gif) return std::make_unique<Gif>(path, options);
  if (extension == ".apng") return open_apng(path, options);
  return std::make_unique<EncodedVideo>(path, options);
}

}  // namespace raysplats
