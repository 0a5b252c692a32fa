// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/parameter_mean.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/trainer.hpp"
#include "run/checkpoint.hpp"
#include "train/schedule.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

constexpr std::size_t kCount = 77;
constexpr int kDegree = 1;

TrainOptions options_of(std::int64_t iterations) {
  TrainOptions options;
  options.iterations = iterations;
  options.sh_degree = kDegree;
  return options;
}

// Parameters that change in every step.
struct Walk {
  CounterRng rng{5, 9};
  DeviceGaussians gaussians;
  Buffer<std::uint32_t> guard;

  explicit Walk(Context& context) : guard(context, 1, "guard") {
    gaussians.count = kCount;
    gaussians.sh_degree = kDegree;
    gaussians.ensure(context, kCount, kDegree, "parameters");
    mark(false);
  }
  void mark(bool marked) { guard.upload(std::vector<std::uint32_t>{marked ? 1u : 0u}); }
  void step() {
    for (const ParameterGroup group : kParameterGroups) {
      std::vector<float> values(kCount * group_width(group, kDegree));
      for (float& value : values) value = static_cast<float>(5.0 + rng.normal());
      gaussians[group].upload(values);
    }
  }
};

std::vector<float> numbers(const DeviceGaussians& gaussians) {
  std::vector<float> out;
  for (const ParameterGroup group : kParameterGroups) {
    const std::vector<float> part = gaussians[group].download();
    out.insert(out.end(), part.begin(), part.end());
  }
  return out;
}

std::vector<float> numbers(const Gaussians& model) {
  std::vector<float> out;
  for (const std::vector<float>* part :
       {&model.means, &model.quaternions, &model.log_scales, &model.opacities, &model.sh})
    out.insert(out.end(), part->begin(), part->end());
  return out;
}

// In double precision.
class Mean {
 public:
  void add(const std::vector<float>& values) {
    sum_.resize(values.size(), 0.0);
    for (std::size_t i = 0; i < values.size(); ++i) sum_[i] += values[i];
    ++samples_;
  }
  int samples() const { return samples_; }
  // The largest difference, in shares of numbers above 1.
  double distance(const std::vector<float>& values) const {
    if (values.size() != sum_.size()) return std::numeric_limits<double>::infinity();
    double worst = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double mean = sum_[i] / samples_;
      worst = std::max(worst, std::abs(values[i] - mean) / std::max(1.0, std::abs(mean)));
    }
    return worst;
  }

 private:
  std::vector<double> sum_;
  int samples_ = 0;
};

}  // namespace

TEST_CASE("the mean is that of all parameters behind its beginning [small]") {
  Context context(test_device());
  for (const std::int64_t iterations : {200, 4000}) {
    CAPTURE(iterations);
    const TrainOptions options = options_of(iterations);
    const std::int64_t from = mean_from(options);
    CHECK(from == iterations * 85 / 100);
    ParameterMean mean(context);
    Walk walk(context);
    Mean reference;
    for (std::int64_t i = from - 3; i <= iterations; ++i) {
      walk.step();
      if (mean.add(options, walk.gaussians, i, walk.guard)) reference.add(numbers(walk.gaussians));
      CHECK(mean.known() == (i > from));
    }
    // Of long runs not every step.
    CHECK(reference.samples() == (iterations == 200 ? 30 : 200));
    CHECK(reference.samples() <= ParameterMean::kMostSamples);
    CHECK(reference.distance(numbers(mean.model())) < 1e-6);
  }
}

TEST_CASE("marked steps leave the mean as it is, repeated ones count once [small]") {
  Context context(test_device());
  const TrainOptions options = options_of(200);
  const std::int64_t from = mean_from(options);
  ParameterMean mean(context);
  Walk walk(context);
  // A first step that found too little room, and again.
  walk.mark(true);
  walk.step();
  mean.add(options, walk.gaussians, from + 1, walk.guard);
  walk.mark(false);
  Mean reference;
  for (std::int64_t i = from + 1; i <= from + 5; ++i) {
    walk.step();
    mean.add(options, walk.gaussians, i, walk.guard);
    reference.add(numbers(walk.gaussians));
  }
  CHECK(reference.distance(numbers(mean.model())) < 1e-6);
  const std::vector<float> before = numbers(mean.model());
  walk.mark(true);
  walk.step();
  mean.add(options, walk.gaussians, from + 6, walk.guard);
  CHECK(numbers(mean.model()) == before);
  // Another set of Gaussians has another mean.
  mean.restart(from + 6);
  CHECK(!mean.known());
  walk.mark(false);
  walk.step();
  mean.add(options, walk.gaussians, from + 7, walk.guard);
  CHECK(numbers(mean.model()) == numbers(walk.gaussians));
  // So it is where nobody says that they are others.
  walk.gaussians.count = kCount / 2;
  walk.step();
  mean.add(options, walk.gaussians, from + 8, walk.guard);
  CHECK(mean.model().count == kCount / 2);
  walk.gaussians.count = kCount;
  walk.step();
  mean.add(options, walk.gaussians, from + 9, walk.guard);
  CHECK(numbers(mean.model()) == numbers(walk.gaussians));
}

TEST_CASE("a run ends with the mean of its last models, resumed or not") {
  const TemporaryDirectory folder;
  const std::string data = (folder.path() / "data").string();
  make_photos(data, 24, 6, 1);
  Context context(test_device());
  TrainOptions options = short_training(40);
  options.init_count = 200;
  options.trace.deterministic = true;
  options.validate_views = 1;  // judges at 36, within what is averaged
  REQUIRE(mean_from(options) == 34);
  TrainOptions plain = options;
  plain.average_from = 0;
  Trainer raw(context, load_dataset(data), plain, folder.path() / "raw");
  Mean reference;
  for (int i = 1; i <= 40; ++i) {
    raw.step();
    if (i > 34) reference.add(numbers(raw.model()));
  }
  REQUIRE(reference.samples() == 6);
  Trainer straight(context, load_dataset(data), options, folder.path() / "straight");
  straight.run(false);
  CHECK(reference.distance(numbers(straight.model())) < 1e-5);
  CHECK(numbers(straight.model()) != numbers(raw.model()));
  // The checkpoint has both.
  const Checkpoint end = load_latest_checkpoint(folder.path() / "straight");
  CHECK(end.sections.at("means") == raw.model().means);
  CHECK(end.sections.at("mean.means") == straight.model().means);

  for (const int stop : {33, 34, 35, 38}) {
    CAPTURE(stop);
    const auto part = folder.path() / ("part" + std::to_string(stop));
    {
      Trainer first(context, load_dataset(data), options, part);
      first.step(stop);
      first.save();
    }
    Trainer rest(context, load_dataset(data), options, part);
    rest.resume("latest");
    rest.run(false);
    check_equal(straight.model(), rest.model());
  }
}

TEST_CASE("means begin when steps are alike, wherever a run ends") {
  TrainOptions options;
  options.iterations = 1000;
  CHECK(mean_from(options) == 850);
  options.average_from = 0;
  CHECK(mean_from(options) == std::numeric_limits<std::int64_t>::max());
  options.average_from = 0.2;
  CHECK(mean_from(options) == 700);  // of 0.65, and 0.05 in which runs by time find their end
  options.average_from = 930;
  CHECK(mean_from(options) == 930);
  options.average_from = 0.85;
  options.end_iteration = 1600;
  CHECK(mean_from(options) == 1360);
  options.end_iteration = 760;
  CHECK(mean_from(options) == 700);
}
