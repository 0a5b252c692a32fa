// SPDX-License-Identifier: Apache-2.0
#include "util/progress.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

namespace raysplats {
namespace {

constexpr double kDrawSeconds = 0.1;   // between redraws of the bar
constexpr double kLineSeconds = 10.0;  // between plain lines
constexpr double kRateSeconds = 1.0;   // between updates of the rate
constexpr double kRateMemory = 20.0;   // seconds that the rate averages over
constexpr double kLongest = 1e12;      // seconds that are told apart
constexpr double kCountable = 1000.0;  // steps a second, of which more tell nobody anything

int terminal_width(std::FILE* stream) {
  winsize size{};
  if (::ioctl(::fileno(stream), TIOCGWINSZ, &size) == 0 && size.ws_col > 0) return size.ws_col;
  return 80;
}

}  // namespace

std::string format_duration(double seconds) {
  const auto total = std::llround(std::min(std::max(0.0, seconds), kLongest));
  if (total >= 3600)
    return fmt::format("{}:{:02}:{:02}", total / 3600, total / 60 % 60, total % 60);
  return fmt::format("{}:{:02}", total / 60, total % 60);
}

Progress::Progress(
    std::string label, std::int64_t total, std::int64_t done, std::FILE* stream, Now now)
    : label_(std::move(label)),
      total_(total),
      done_(done),
      stream_(stream),
      terminal_(stream != nullptr && ::isatty(::fileno(stream)) == 1),
      now_(now),
      rate_done_(done),
      start_(now()) {}

Progress::~Progress() {
  if (stream_ != nullptr && terminal_ && drawn_ && !finished_ && !suspended_)
    std::fputc('\n', stream_);
}

double Progress::clock() const { return std::chrono::duration<double>(now_() - start_).count(); }

void Progress::update(std::int64_t done, const std::string& fields) {
  done_ = done;
  fields_ = fields;
  const double now = clock();
  const double elapsed = now - rate_time_;
  // A step that lasts is no sign of a lower rate before it is done.
  if (done_ > rate_done_ && elapsed > 0 && (elapsed >= kRateSeconds || rate_ == 0)) {
    const double recent = static_cast<double>(done_ - rate_done_) / elapsed;
    // A mean over the time so far, of which what is long ago counts less.
    const double weight = std::expm1(-elapsed / kRateMemory) / std::expm1(-now / kRateMemory);
    rate_ += weight * (recent - rate_);
    rate_time_ = now;
    rate_done_ = done_;
  }
  if (now - last_draw_ >= (terminal_ ? kDrawSeconds : kLineSeconds)) draw(false);
}

void Progress::finish() {
  if (finished_) return;
  // A plain line for this state may have been printed already.
  if (terminal_ || drawn_done_ != done_) draw(true);
  finished_ = true;
}

void Progress::suspend() {
  if (suspended_) return;
  suspended_ = true;
  suspended_at_ = now_();
  if (stream_ != nullptr && terminal_ && drawn_) {
    std::fputs("\r\x1b[K", stream_);
    std::fflush(stream_);
  }
}

void Progress::resume() {
  if (!suspended_) return;
  suspended_ = false;
  start_ += now_() - suspended_at_;
}

std::string Progress::line(int width) const {
  const bool known = total_ != kUnknown;
  const double share =
      total_ > 0 ? std::clamp(static_cast<double>(done_) / static_cast<double>(total_), 0.0, 1.0)
                 : 1.0;
  // A narrow terminal cuts off the end.
  std::string text = known ? fmt::format("{}/{}", done_, total_) : std::to_string(done_);
  const bool steady = rate_ > 0 && known;
  if (steady)
    text += fmt::format(", {} left", format_duration(static_cast<double>(total_ - done_) / rate_));
  if (!fields_.empty()) text += ", " + fields_;
  if (steady && rate_ < kCountable)
    text += fmt::format(", {:.{}f} it/s", rate_, rate_ < 10 ? 2 : 1);
  const int room = std::clamp(width - static_cast<int>(label_.size() + text.size()) - 5, 0, 30);
  if (room < 5)
    return fmt::format("{} {}", label_, text)
        .substr(0, static_cast<std::size_t>(std::max(width, 1)));
  if (!known) {
    constexpr int kBlock = 3;
    const int turn = 2 * (room - kBlock);
    const int at = static_cast<int>(done_ % turn);
    const int before = std::min(at, turn - at);
    return fmt::format("{} [{:<{}}==={:<{}}] {}", label_, "", before, "", room - kBlock - before,
                       text);
  }
  const int filled = static_cast<int>(share * room);
  return fmt::format("{} [{:=<{}}{:<{}}] {}", label_, "", filled, "", room - filled, text);
}

void Progress::draw(bool last) {
  if (stream_ == nullptr) return;
  // One column of a terminal stays free: a full line would wrap.
  const std::string text =
      terminal_ ? fmt::format("\r\x1b[K{}{}", line(terminal_width(stream_) - 1), last ? "\n" : "")
                : fmt::format("{}\n", line(200).substr(0, 200));
  // A log that is full is no reason to stop what it tells of.
  std::fputs(text.c_str(), stream_);
  std::fflush(stream_);
  drawn_ = true;
  drawn_done_ = done_;
  last_draw_ = clock();
}

}  // namespace raysplats
