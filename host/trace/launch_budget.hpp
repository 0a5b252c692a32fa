// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <utility>

#include "device/context.hpp"
#include "device/launch_timer.hpp"
#include "raysplats/device.hpp"

namespace raysplats {

/// How many rows (of tiles, or groups of rays or of segments) one launch may do, so that it ends
/// within a time: the watchdogs of GPUs that also draw a screen stop kernels after some seconds,
/// and a long kernel freezes the screen. The size follows the times of the launches before, by the
/// device's clock: the first ones are waited for until one took the time that it should, the others
/// are looked at when they have run.
class LaunchBudget {
 public:
  /// `milliseconds` per launch; 0 = no bound, negative = none on CPUs and kDefault elsewhere. The
  /// first launch does `first` rows.
  LaunchBudget(double milliseconds, DeviceType device, std::uint32_t first = kFirstRows);

  /// Where nothing is known of what a row costs.
  static constexpr std::uint32_t kFirstRows = 4;

  static constexpr double kDefault = 100.0;
  /// While somebody watches, where no other time bounds them.
  static constexpr double kWatched = 300.0;

  /// Lets `watch` hear, from the next in_bands() on, the share of its rows that is done after every
  /// launch, when that is over; what it throws ends the work. Nothing is heard with {}.
  void set_watch(std::function<void(double share)> watch) { watch_ = std::move(watch); }
  const std::function<void(double share)>& watch() const { return watch_; }

  bool bounded() const { return limit() > 0; }
  /// Rows of the next launch when `left` are to be done; at least 1.
  std::uint32_t rows(std::uint32_t left);
  /// A launch of `rows` rows took `seconds`.
  void record(std::uint32_t rows, double seconds);
  /// The same for one that is enqueued, `all` if nothing was left behind it.
  void record(std::uint32_t rows, bool all, LaunchTimer timer);

 private:
  struct Launch {
    std::uint32_t rows;
    LaunchTimer timer;
  };

  double limit() const { return watch_ && seconds_ == 0 ? 1e-3 * kWatched : seconds_; }

  double seconds_;
  std::function<void(double)> watch_;
  std::uint32_t rows_;
  bool settled_ = false;         // rows_ fits what a launch took, or all rows fit one
  std::deque<Launch> launches_;  // whose time is not known yet
};

/// Calls launch(first, number) until all `rows` are done, as many at once as the budget of time
/// allows.
template <class Launch>
void in_bands(Context& context, LaunchBudget& budget, std::uint32_t rows, const Launch& launch) {
  for (std::uint32_t row = 0; row < rows;) {
    const std::uint32_t now = budget.rows(rows - row);
    if (budget.bounded()) {
      LaunchTimer timer(context);
      launch(row, now);
      timer.stop();
      budget.record(now, row == 0 && now == rows, std::move(timer));
    } else {
      launch(row, now);
    }
    row += now;
    if (!budget.watch()) continue;
    context.finish();
    budget.watch()(static_cast<double>(row) / rows);
  }
}

/// The same for a kernel of one dimension whose work-items go by their global id: `items` of them
/// in groups of `group`, a row.
template <class... Arguments>
void launch_in_bands(Context& context,
                     LaunchBudget& budget,
                     Kernel kernel,
                     std::size_t items,
                     std::size_t group,
                     const Arguments&... arguments) {
  const auto groups = static_cast<std::uint32_t>((items + group - 1) / group);
  in_bands(context, budget, groups, [&](std::uint32_t first, std::uint32_t number) {
    Range range = Range::linear(number * group, group);
    range.offset[0] = first * group;
    kernel.launch(range, arguments...);
  });
}

}  // namespace raysplats
