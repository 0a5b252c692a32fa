// SPDX-License-Identifier: Apache-2.0
// Animated PNG (APNG 1.0, now part of the third edition of PNG): the frames of a PNG one after the
// other, each with a chunk that says how long it stays.
#include <fmt/format.h>
#include <zlib.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "io/image/video_file.hpp"
#include "io/image/video_frame.hpp"
#include "raysplats/error.hpp"
#include "util/atomic_file.hpp"

namespace raysplats {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::array<std::uint8_t, 8> kSignature{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr std::uint16_t kDelayUnit = 1000;  // parts of a second
constexpr int kLevel = 6;
constexpr std::size_t kPixel = 3;

void put32(Bytes& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    out.push_back(static_cast<std::uint8_t>(value >> shift));
}
void put16(Bytes& out, std::uint16_t value) {
  out.push_back(static_cast<std::uint8_t>(value >> 8));
  out.push_back(static_cast<std::uint8_t>(value));
}

/// Each row with the filter, none, left, above or their mean, that leaves the smallest numbers.
Bytes filtered(const Bytes& rgb, std::size_t width, std::size_t height) {
  const std::size_t row = kPixel * width;
  const Bytes black(row, 0);
  Bytes out;
  out.reserve((row + 1) * height);
  std::array<Bytes, 4> tries;
  for (std::size_t y = 0; y < height; ++y) {
    const std::uint8_t* now = &rgb[y * row];
    const std::uint8_t* above = y > 0 ? now - row : black.data();
    std::size_t best = 0;
    std::uint64_t least = UINT64_MAX;
    for (std::size_t kind = 0; kind < tries.size(); ++kind) {
      Bytes& line = tries[kind];
      line.resize(row);
      std::uint64_t sum = 0;
      for (std::size_t x = 0; x < row; ++x) {
        const int left = x >= kPixel ? now[x - kPixel] : 0;
        const std::array<int, 4> guesses{0, left, above[x], (left + above[x]) / 2};
        line[x] = static_cast<std::uint8_t>(now[x] - guesses[kind]);
        sum += static_cast<std::uint64_t>(std::abs(static_cast<std::int8_t>(line[x])));
      }
      if (sum < least) {
        least = sum;
        best = kind;
      }
    }
    out.push_back(static_cast<std::uint8_t>(best));  // in the order of PNG's numbers
    out.insert(out.end(), tries[best].begin(), tries[best].end());
  }
  return out;
}

Bytes deflated(const Bytes& data) {
  uLongf size = ::compressBound(data.size());
  Bytes out(size);
  if (::compress2(out.data(), &size, data.data(), data.size(), kLevel) != Z_OK)
    throw ResourceError("zlib has no memory left for a frame");
  out.resize(size);
  return out;
}

class Apng : public VideoFile {
 public:
  Apng(const std::filesystem::path& path, const VideoOptions& options)
      : path_(path), file_(path), options_(options) {}

  void add(const Image& frame) override {
    const bool first = size_.width == 0;
    size_.require(frame, path_);
    if (first) begin();
    control();
    const Bytes data = deflated(filtered(rgb_bytes(frame), static_cast<std::size_t>(size_.width),
                                         static_cast<std::size_t>(size_.height)));
    if (first) {
      chunk("IDAT", data);
    } else {
      Bytes numbered;
      put32(numbered, sequence_++);
      numbered.insert(numbered.end(), data.begin(), data.end());
      chunk("fdAT", numbered);
    }
    ++frames_;
  }
  void finish() override {
    if (frames_ != options_.frames) {
      throw UsageError(fmt::format("The video {} was to have {} frames and got {}", path_.string(),
                                   options_.frames, frames_));
    }
    chunk("IEND", {});
    file_.commit();
  }

 private:
  void chunk(const char (&type)[5], const Bytes& data) {
    Bytes head;
    put32(head, static_cast<std::uint32_t>(data.size()));
    head.insert(head.end(), type, type + 4);
    Bytes tail;
    uLong sum = ::crc32(0, head.data() + 4, 4);
    if (!data.empty()) sum = ::crc32_z(sum, data.data(), data.size());
    put32(tail, static_cast<std::uint32_t>(sum));
    file_.write(head.data(), head.size());
    file_.write(data.data(), data.size());
    file_.write(tail.data(), tail.size());
  }
  void begin() {
    file_.write(kSignature.data(), kSignature.size());
    Bytes header;
    put32(header, static_cast<std::uint32_t>(size_.width));
    put32(header, static_cast<std::uint32_t>(size_.height));
    header.insert(header.end(), {8, 2, 0, 0, 0});  // 8 bits, RGB, not interlaced
    chunk("IHDR", header);
    chunk("sRGB", {0});
    Bytes animation;
    put32(animation, static_cast<std::uint32_t>(options_.frames));
    put32(animation, 0);  // for ever
    chunk("acTL", animation);
  }
  void control() {
    Bytes data;
    put32(data, sequence_++);
    put32(data, static_cast<std::uint32_t>(size_.width));
    put32(data, static_cast<std::uint32_t>(size_.height));
    put32(data, 0);
    put32(data, 0);
    // Moments of the frames are rounded, not their lengths, so that nothing adds up.
    const auto moment = [&](std::size_t frame) {
      return std::llround(static_cast<double>(frame) * kDelayUnit / options_.fps);
    };
    put16(data, static_cast<std::uint16_t>(moment(frames_ + 1) - moment(frames_)));
    put16(data, kDelayUnit);
    data.insert(data.end(), {0, 0});  // stays until the next, which replaces it
    chunk("fcTL", data);
  }

  std::filesystem::path path_;
  AtomicFile file_;
  VideoOptions options_;
  FrameSize size_;
  std::uint32_t sequence_ = 0;
  std::size_t frames_ = 0;
};

}  // namespace

std::unique_ptr<VideoFile> open_apng(const std::filesystem::path& path,
                                     const VideoOptions& options) {
  return std::make_unique<Apng>(path, options);
}

}  // namespace raysplats
