// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstdlib>
#include <string>

#include "device/context.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"

using namespace raysplats;

namespace {

// Generated photos in a folder that goes with the object.
struct Photos {
  TemporaryDirectory folder;
  Photos() { make_photos(folder / "data", 48, 6, 1); }
};

// Without density control and with a report at the end alone.
TrainOptions quiet_training() {
  TrainOptions options = short_training(60);
  options.init_count = 400;
  options.sh_degree = 1;
  options.densify_until = 0;
  options.log_every = 1000;
  options.trace.deterministic = true;
  return options;
}

Gaussians trained(const Photos& photos, const TrainOptions& options, const char* fault, int at) {
  ::setenv(fault, std::to_string(at).c_str(), 1);
  Context context(test_device());
  ::unsetenv(fault);
  Trainer trainer(context, load_dataset((photos.folder / "data").string()), options,
                  photos.folder / "run", true);
  trainer.step(30);
  CHECK(trainer.iteration() == 30);
  return trainer.model();
}

}  // namespace

TEST_CASE("between reports and density passes the host never waits for the device to run dry") {
  const Photos photos;
  Context context(test_device());
  TrainOptions options = quiet_training();
  options.iterations = 240;
  for (const double budget : {-1.0, 1000.0}) {
    CAPTURE(budget);
    options.trace.launch_budget_ms = budget;
    options.image_budget = budget < 0 ? 1024 : 0;  // then every photo comes again for its step
    Trainer trainer(context, load_dataset((photos.folder / "data").string()), options,
                    photos.folder / "run", true);
    // Photos, room and sizes of launches come with the first steps; a model that grows needs more
    // room now and then.
    std::uint64_t waits = 1;
    for (int block = 0; block < 10 && waits > 0; ++block) {
      const std::uint64_t before = context.host_waits();
      trainer.step(20);
      waits = context.host_waits() - before;
    }
    CHECK(waits == 0);
    const std::uint64_t before = context.host_waits();
    trainer.step(options.iterations);  // with the report of the last one
    CHECK(context.host_waits() > before);
  }
}

TEST_CASE("photos that come again for every step train as those that stay on the device") {
  const Photos photos;
  TrainOptions options = quiet_training();
  const Gaussians stayed = trained(photos, options, "RAYSPLATS_FAIL_HITS", 0);
  options.image_budget = 0;
  const Gaussians came = trained(photos, options, "RAYSPLATS_FAIL_HITS", 0);
  CHECK(came.means == stayed.means);
  CHECK(came.log_scales == stayed.log_scales);
  CHECK(came.opacities == stayed.opacities);
  CHECK(came.sh == stayed.sh);
}

TEST_CASE("steps whose views had no room are made again and leave the same parameters") {
  const Photos photos;
  const TrainOptions options = quiet_training();
  const Gaussians undisturbed = trained(photos, options, "RAYSPLATS_FAIL_HITS", 0);
  CHECK(undisturbed.size() == 400);
  for (const char* fault : {"RAYSPLATS_FAIL_HITS", "RAYSPLATS_FAIL_LISTS"}) {
    for (const int at : {1, 5, 29}) {  // the last view of step() among them
      CAPTURE(fault);
      CAPTURE(at);
      const Gaussians model = trained(photos, options, fault, at);
      CHECK(model.means == undisturbed.means);
      CHECK(model.log_scales == undisturbed.log_scales);
      CHECK(model.opacities == undisturbed.opacities);
      CHECK(model.sh == undisturbed.sh);
    }
  }
}
