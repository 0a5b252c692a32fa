// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <string>

namespace raysplats {

/// "1:05" or "2:03:04".
std::string format_duration(double seconds);

/// Progress of long work on a stream: a bar that is redrawn in place on a terminal, otherwise a
/// plain line every few seconds. Time between suspend() and resume() counts neither for the rate
/// nor for the time left.
class Progress {
 public:
  /// A total that nobody knows: the bar runs to and fro.
  static constexpr std::int64_t kUnknown = -1;

  using Now = std::chrono::steady_clock::time_point (*)();

  /// `done` of `total` steps are behind us already (a resumed run). A null stream prints nothing.
  Progress(std::string label,
           std::int64_t total,
           std::int64_t done = 0,
           std::FILE* stream = stderr,
           Now now = std::chrono::steady_clock::now);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Another number of steps in all, from the next update() on.
  void set_total(std::int64_t total) { total_ = total; }
  /// Reports that `done` steps are behind us, also while one of them lasts; `fields` is what
  /// follows the bar ("loss 0.12, PSNR 21.3").
  void update(std::int64_t done, const std::string& fields);
  /// Draws the last state with a line end.
  void finish();
  /// Clears the bar so that other output can be written, and stops the clock.
  void suspend();
  void resume();

  /// The stream where it is a terminal, for a bar that takes this one's place while it is
  /// suspended; else null.
  std::FILE* terminal() const { return terminal_ ? stream_ : nullptr; }
  /// Steps per second over the recent past.
  double rate() const { return rate_; }
  /// The line as it would be drawn in `width` columns.
  std::string line(int width) const;

 private:
  double clock() const;
  void draw(bool last);

  std::string label_;
  std::string fields_;
  std::int64_t total_;
  std::int64_t done_;
  std::FILE* stream_;
  bool terminal_;
  Now now_;
  bool drawn_ = false;
  std::int64_t drawn_done_ = -1;
  bool finished_ = false;
  double rate_ = 0;
  double rate_time_ = 0;  ///< clock and steps at the last change of the rate
  std::int64_t rate_done_;
  double last_draw_ = -1e9;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point suspended_at_;
  bool suspended_ = false;
};

}  // namespace raysplats
