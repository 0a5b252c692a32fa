// SPDX-License-Identifier: Apache-2.0
#include "view/run_view.hpp"

#include <spdlog/spdlog.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <utility>

#include "util/json_text.hpp"

namespace raysplats::view {
namespace {

constexpr double kRestSeconds = 0.25;  // of a picture for pages that rest, while the run goes on
constexpr double kPausedWait = 0.05;   // seconds until a paused run asks whether it is to end

}  // namespace

RunView::RunView(Context& context,
                 const DeviceGaussians& gaussians,
                 const TraceOptions& trace,
                 const Mirrors& mirrors,
                 std::int64_t iterations,
                 ViewerOptions options)
    : history_(iterations),
      pictures_(context, gaussians, trace, mirrors),
      viewer_((
          options.run = [this] { return history_.json(); }, options)) {
  history_.set_state(paused_, time_.share());
  viewer_.set_hurry(kRestSeconds);
  viewer_.on_command([this](const RunCommand& command) { obey(command); });
}

std::vector<std::string> RunView::urls() const { return viewer_.urls(); }

void RunView::finish(const std::string& text) {
  history_.finish(text);
  viewer_.tell_last(json_text(nlohmann::json{{"type", "run"}, {"ended", text}}));
}

void RunView::noted(const TrainRow& row) { history_.add(row); }
void RunView::evaluated(const EvaluationRow& row) { history_.add(row); }
void RunView::will_end(std::int64_t iteration) { history_.set_iterations(iteration); }

void RunView::obey(const RunCommand& command) {
  using Kind = RunCommand::Kind;
  switch (command.kind) {
    case Kind::kPause:
      if (!paused_) spdlog::info("paused by the page, which also resumes; Ctrl-C saves and ends");
      paused_ = true;
      break;
    case Kind::kResume:
      if (paused_) spdlog::info("resumed by the page");
      paused_ = false;
      break;
    case Kind::kSave:
      save_ = true;
      break;
    case Kind::kShare:
      time_.set_share(command.share);
      break;
  }
  // A paused run has all the time for a picture of full size.
  viewer_.set_hurry(paused_ ? 0.0 : kRestSeconds);
  viewer_.refresh();
  history_.set_state(paused_, time_.share());
  viewer_.tell(nlohmann::json{{"type", "run"}}.dump());
}

bool RunView::wants_look() {
  const Clock::time_point now = Clock::now();
  const double passed = std::chrono::duration<double>(now - last_).count();
  last_ = now;
  if (viewer_.asked()) return true;
  if (viewer_.watchers() == 0) {
    time_.reset();
    return false;
  }
  time_.pass(passed, viewer_.seconds_since_motion());
  return time_.free();
}

RunWish RunView::look(const RunMoment& moment, const std::function<bool()>& stopping) {
  const Clock::time_point start = Clock::now();
  const bool goes_on = !paused_;
  pictures_.set_gaussians(*moment.model);
  pictures_.set_background(moment.background, moment.sky);
  // The model is another one than that of the last picture.
  if (goes_on && !viewer_.awaited()) viewer_.refresh();
  // What cannot be drawn is the page's trouble: the run itself goes on.
  viewer_.work(pictures_, moment.iteration, paused_ ? kPausedWait : 0.0, stopping);
  if (goes_on) time_.spend(std::chrono::duration<double>(Clock::now() - start).count());
  return {paused_, std::exchange(save_, false)};
}

}  // namespace raysplats::view
