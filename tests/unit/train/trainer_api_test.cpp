// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <spdlog/details/null_mutex.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <cmath>
#include <future>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <vector>

#include "device/context.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "run/checkpoint.hpp"
#include "unit/fixture.hpp"
#include "unit/train/photographed.hpp"

using namespace raysplats;

namespace {

std::vector<Camera> cameras_around() {
  std::vector<Camera> out;
  for (int i = 0; i < 10; ++i) {
    const double angle = 0.628 * i;
    out.push_back(
        look_at({3 * std::cos(angle), 3 * std::sin(angle), 1.0}, {0, 0, 0}, {0, 0, 1}, 32, 28, 36));
  }
  return out;
}

struct Photos : Photographed {
  Photos() : Photographed(coloured_cloud(40, 0.6, 21, 0.0f), cameras_around()) {}
};

TrainOptions small_options() {
  TrainOptions options;
  options.iterations = 24;
  options.init_count = 150;
  options.sh_degree = 0;
  options.densify_from = 5;
  options.densify_until = 20;
  options.densify_every = 5;
  options.densify_grad_threshold = 1e-6;
  options.max_gaussians = 400;
  options.resolution_schedule = {};
  options.log_every = 10;
  options.eval_at = {};
  options.save_at = {};
  options.checkpoint_every = 0;
  options.trace.memory_budget = std::size_t{64} << 20;
  return options;
}

struct Stop : std::runtime_error {
  Stop() : std::runtime_error("enough") {}
};

/// Hears which of the messages that contain `part` are logged while other threads have to wait for
/// the context.
class TurnSink : public spdlog::sinks::base_sink<spdlog::details::null_mutex> {
 public:
  TurnSink(const Context& context, std::string_view part) : context_(&context), part_(part) {}
  std::vector<bool> waits;

 private:
  void sink_it_(const spdlog::details::log_msg& message) override {
    if (std::string_view(message.payload.data(), message.payload.size()).find(part_) ==
        std::string_view::npos)
      return;
    others_.push_back(
        std::async(std::launch::async, [this] { const auto turn = context_->lock(); }));
    waits.push_back(others_.back().wait_for(std::chrono::milliseconds(500)) ==
                    std::future_status::timeout);
  }
  void flush_() override {}

  const Context* context_;
  std::string_view part_;
  std::vector<std::future<void>> others_;  // wait until the log is over
};

}  // namespace

TEST_CASE("steps of one's own train as a run does") {
  Photos photos;
  const TrainOptions options = small_options();
  Trainer run(photos.context, photos.dataset, options, photos.folder / "run");
  std::vector<std::int64_t> heard;
  run.on_step([&](const TrainProgress& progress) {
    heard.push_back(progress.iteration);
    CHECK(progress.iterations == 24);
    CHECK(progress.gaussians == run.model().size());
    CHECK(run.loss().total > 0.0);
  });
  const TrainSummary summary = run.run(false);
  CHECK(heard.size() == 24);
  CHECK(heard.back() == 24);

  Trainer steps(photos.context, photos.dataset, options, photos.folder / "steps");
  CHECK(steps.model().size() == 0);
  CHECK_THROWS_AS(steps.loss(), UsageError);
  CHECK_THROWS_AS(steps.step(0), UsageError);
  int calls = 0;
  while (steps.step(5)) ++calls;
  CHECK(calls == 4);
  CHECK(!steps.step());
  CHECK(steps.iteration() == 24);
  const Gaussians a = run.model(), b = steps.model();
  CHECK(a.size() == summary.gaussians);
  if (photos.context.device().type == DeviceType::kCpu) {
    CHECK(a.means == b.means);
    CHECK(a.sh == b.sh);
  }
  const EvaluationRow row = steps.evaluate();
  CHECK(row.views == 2);
  CHECK(row.psnr == doctest::Approx(summary.evaluations.back().psnr).epsilon(0.01));
}

TEST_CASE("a trainer takes its turn at the context while it is made") {
  Photos photos;
  auto turn = photos.context.lock();
  auto made = std::async(std::launch::async, [&] {
    const Trainer trainer(photos.context, photos.dataset, small_options(), photos.folder / "run");
  });
  CHECK(made.wait_for(std::chrono::seconds(2)) == std::future_status::timeout);
  turn.unlock();
  CHECK_NOTHROW(made.get());
}

TEST_CASE("a run takes its turn at the context for what follows its steps") {
  Photos photos;
  TrainOptions options = small_options();
  options.trace.max_hits = 1;
  Trainer trainer(photos.context, photos.dataset, options, photos.folder / "run");
  const auto sink = std::make_shared<TurnSink>(photos.context, "--max-hits");
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("turns", sink));
  trainer.run(false);
  spdlog::set_default_logger(before);
  CHECK(sink->waits == std::vector<bool>{true, true});  // in the run, and at its end
}

TEST_CASE("a state is not taken back while the trainer trains") {
  Photos photos;
  Trainer trainer(photos.context, photos.dataset, small_options(), photos.folder / "run");
  trainer.step(2);
  trainer.save();
  int calls = 0;
  trainer.on_step([&](const TrainProgress&) {
    if (++calls > 2) trainer.stop();
    CHECK_THROWS_AS(trainer.resume("latest"), UsageError);
  });
  trainer.step(2);
  CHECK(calls == 2);
  CHECK(trainer.iteration() == 4);
  trainer.on_step(nullptr);
  trainer.resume("latest");
  CHECK(trainer.iteration() == 2);
}

TEST_CASE("test photos are read once in a run where the budget has room for them") {
  Photos photos;
  TrainOptions options = small_options();
  const Image black(32, 28, 3);
  for (const bool room : {true, false}) {
    CAPTURE(room);
    options.image_budget = room ? 1 : 0;
    const View& view = photos.dataset.views.front();
    REQUIRE(view.test);
    const Image photo = read_image(view.image_path);
    Trainer trainer(photos.context, photos.dataset, options,
                    photos.folder / (room ? "roomy" : "narrow"));
    trainer.step(2);
    const EvaluationRow first = trainer.evaluate();
    write_image(view.image_path, black);
    const EvaluationRow second = trainer.evaluate();
    CHECK((second.psnr == first.psnr) == room);
    CHECK((second.ssim == first.ssim) == room);
    write_image(view.image_path, photo);
    const EvaluationRow third = trainer.evaluate();
    CHECK(third.psnr == first.psnr);
    CHECK(third.ssim == first.ssim);
  }
}

TEST_CASE("what is saved in a callback is what a run goes on from") {
  Photos photos;
  const TrainOptions options = small_options();
  Trainer whole(photos.context, photos.dataset, options, photos.folder / "whole");
  while (whole.step(100)) {
  }
  {
    Trainer first(photos.context, photos.dataset, options, photos.folder / "parts");
    first.on_step([&](const TrainProgress& progress) {
      // At a step after which density control changes the model.
      if (progress.iteration != 10) return;
      first.save();
      first.stop();
    });
    const TrainSummary summary = first.run(false);
    CHECK(summary.iterations == 10);
  }
  Trainer second(photos.context, photos.dataset, options, photos.folder / "parts");
  second.resume("latest");
  CHECK(second.iteration() == 10);
  second.run(false);
  if (photos.context.device().type == DeviceType::kCpu) {
    CHECK(second.model().means == whole.model().means);
  }
}

TEST_CASE("a callback that is refused while the trainer trains leaves the one that is heard") {
  Photos photos;
  Trainer trainer(photos.context, photos.dataset, small_options(), photos.folder / "run");
  std::vector<std::int64_t> heard;
  bool other = false;
  trainer.on_step([&](const TrainProgress& progress) {
    heard.push_back(progress.iteration);
    const auto replace = [&] { trainer.on_step([&](const TrainProgress&) { other = true; }); };
    CHECK_THROWS_AS(replace(), UsageError);
    if (progress.iteration == 3) trainer.stop();
  });
  trainer.step(10);
  CHECK(heard == std::vector<std::int64_t>{1, 2, 3});
  CHECK(!other);
  // It may end itself, and be replaced once it is over.
  trainer.on_step([&](const TrainProgress&) { trainer.on_step(nullptr); });
  CHECK(trainer.step(2));
  trainer.on_step([&](const TrainProgress&) { other = true; });
  CHECK(trainer.step(1));
  CHECK(other);
}

TEST_CASE("a trainer refuses to train twice at a time, and lets a callback's exception out") {
  Photos photos;
  Trainer trainer(photos.context, photos.dataset, small_options(), photos.folder / "run");
  trainer.on_step([&](const TrainProgress&) { CHECK_THROWS_AS(trainer.step(), UsageError); });
  trainer.step();
  trainer.on_step([&](const TrainProgress& progress) {
    if (progress.iteration == 4) throw Stop();
  });
  CHECK_THROWS_AS(trainer.run(false), Stop);
  CHECK(trainer.iteration() == 4);
  // The state is saved, and the trainer goes on.
  CHECK(load_latest_checkpoint(photos.folder / "run").iteration == 4);
  trainer.on_step(nullptr);
  CHECK(trainer.step(2));
  CHECK(trainer.iteration() == 6);

  // From another thread.
  std::thread other;
  bool refused = false;
  trainer.on_step([&](const TrainProgress& progress) {
    if (progress.iteration != 8) return;
    other = std::thread([&] {
      try {
        trainer.run(false);
      } catch (const UsageError&) {
        refused = true;
      }
      trainer.stop();
    });
    other.join();
  });
  const TrainSummary summary = trainer.run(false);
  CHECK(refused);
  CHECK(summary.iterations == 8);

  // Another trainer of the same folder.
  Trainer second(photos.context, photos.dataset, small_options(), photos.folder / "run");
  CHECK_THROWS_AS(second.step(), DataError);

  Dataset untested = photos.dataset;
  for (View& view : untested.views) view.test = false;
  Trainer blind(photos.context, untested, small_options(), photos.folder / "blind");
  CHECK_THROWS_AS(blind.evaluate(), UsageError);
}
