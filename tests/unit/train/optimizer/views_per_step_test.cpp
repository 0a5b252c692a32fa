// SPDX-License-Identifier: Apache-2.0
// Steps of several views: the sum of their gradients, and runs that are made of such steps.
#include <doctest/doctest.h>

#include <filesystem>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/trainer.hpp"
#include "train/optimizer/gradient_tree.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

constexpr std::size_t kGaussians = 37;
constexpr int kShDegree = 1;

// The gradients of a view in a slot: functions of both alone.
std::vector<float> numbers(std::size_t slot, std::uint64_t part, std::size_t count) {
  CounterRng rng(slot + 1, part);
  std::vector<float> out(count);
  for (float& value : out) value = static_cast<float>(rng.normal());
  return out;
}

constexpr std::size_t kScreen = GaussianGradients::kScreenNumbers * kGaussians;

void fill(Context& context, std::size_t slot, StepGradients& out) {
  out.gaussians.Parameters::ensure(context, kGaussians, kShDegree, "gradients");
  std::uint64_t part = 0;
  for (const ParameterGroup group : kParameterGroups) {
    Buffer<float>& buffer = out.gaussians[group];
    buffer.upload(numbers(slot, part++, buffer.size()));
  }
  out.gaussians.screen.ensure(context, kScreen, "screen");
  out.gaussians.screen.upload(numbers(slot, part++, kScreen));
  out.sky.ensure(context, 12, "sky");
  out.sky.upload(numbers(slot, part, 12));
}

// Pairs of neighbours first, in single precision as the device adds.
std::vector<float> tree_sum(std::vector<std::vector<float>> slots) {
  std::vector<std::vector<float>> rest;  // sums of the largest powers of two first
  for (std::size_t size = 1; size <= slots.size(); size *= 2) {
    if ((slots.size() & size) == 0) continue;
    // The last slots that are not in larger blocks.
    const std::size_t end = slots.size() & ~(size - 1);
    std::vector<std::vector<float>> block(slots.begin() + static_cast<std::ptrdiff_t>(end - size),
                                          slots.begin() + static_cast<std::ptrdiff_t>(end));
    while (block.size() > 1) {
      std::vector<std::vector<float>> next;
      for (std::size_t i = 0; i < block.size(); i += 2) {
        for (std::size_t k = 0; k < block[i].size(); ++k) block[i][k] += block[i + 1][k];
        next.push_back(block[i]);
      }
      block = next;
    }
    rest.push_back(block.front());
  }
  std::vector<float> sum = rest.front();
  for (std::size_t i = 1; i < rest.size(); ++i) {
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] = rest[i][k] + sum[k];
  }
  return sum;
}

Dataset photos_in(const fs::path& folder) {
  make_photos(folder, 24, 7, 2, SyntheticScene::kOutdoor);
  return load_dataset(folder);
}

TrainOptions steps_of(int views, int iterations) {
  TrainOptions options = short_training(iterations);
  options.views_per_step = views;
  options.max_gaussians = 500;
  options.resolution_schedule = {};
  return options;
}

}  // namespace

TEST_CASE("gradients of a step's views are added in a fixed tree, bit for bit [small]") {
  Context context{test_device()};
  GradientTree tree(context);
  Communicator alone;
  DeviceGaussians gaussians;
  gaussians.count = kGaussians;
  gaussians.sh_degree = kShDegree;
  StepGradients sum;
  for (const std::size_t views : {1u, 2u, 3u, 4u, 5u, 7u, 8u, 11u}) {
    CAPTURE(views);
    tree.begin(alone, views, gaussians);
    for (std::size_t slot = 0; slot < views; ++slot) {
      fill(context, slot, sum);
      tree.add(slot, sum);
    }
    tree.finish(sum);
    const auto check = [&](std::uint64_t part, const Buffer<float>& got) {
      std::vector<std::vector<float>> slots;
      for (std::size_t slot = 0; slot < views; ++slot)
        slots.push_back(numbers(slot, part, got.size()));
      CHECK(got.download() == tree_sum(slots));
    };
    std::uint64_t part = 0;
    for (const ParameterGroup group : kParameterGroups) check(part++, sum.gaussians[group]);
    check(part++, sum.gaussians.screen);
    check(part, sum.sky);
  }
  CHECK_THROWS_AS(tree.finish(sum), UsageError);
}

TEST_CASE("a step of several views goes down the sum of their single gradients") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const Dataset dataset = photos_in(folder.path() / "data");
  // Adam without memory and with an epsilon far above the gradients is plain descent; its steps are
  // so small that a second one meets the gradient that the first would have met.
  const auto moved = [&](int views, int steps, double rate, const std::string& name) {
    TrainOptions options = steps_of(views, 100);
    options.adam_beta1 = 0;
    options.adam_beta2 = 0;
    options.adam_epsilon = 1;
    options.position_lr = options.sh_rest_lr = options.scale_lr = options.rotation_lr = {0, 0};
    options.opacity_lr = options.sh_lr = {rate, rate};
    options.footprint = 0;
    options.densify_until = 0;
    Trainer trainer(context, dataset, options, folder.path() / name);
    trainer.step(steps);
    return trainer.model();
  };
  const Gaussians start = moved(1, 1, 0, "start");
  const Gaussians first = moved(1, 1, 1, "first"), both_apart = moved(1, 2, 1, "apart");
  const Gaussians together = moved(2, 1, 1, "together");
  REQUIRE(first.size() == start.size());
  REQUIRE(together.size() == start.size());
  double square = 0, off = 0, from_first = 0;
  for (std::size_t i = 0; i < start.sh.size(); ++i) {
    const double apart = static_cast<double>(both_apart.sh[i] - start.sh[i]);
    const double joint = static_cast<double>(together.sh[i] - start.sh[i]);
    const double single = static_cast<double>(first.sh[i] - start.sh[i]);
    square += apart * apart;
    off += (apart - joint) * (apart - joint);
    from_first += (single - joint) * (single - joint);
  }
  CHECK(square > 0);
  CHECK(off < 1e-2 * square);
  CHECK(from_first > 0.05 * square);
}

TEST_CASE("runs of several views a step are the same every time and resume bit for bit") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const Dataset dataset = photos_in(folder.path() / "data");
  for (const bool extras : {false, true}) {
    CAPTURE(extras);
    TrainOptions options = steps_of(3, 60);
    // Elsewhere than on CPUs gradients are atomic sums otherwise.
    options.trace.deterministic = true;
    options.exposure = options.sparse_adam = extras;
    if (extras) options.background = "sky";
    options.strategy = extras ? DensityStrategy::kMcmc : DensityStrategy::kBudget;
    const std::string name = extras ? "extras_" : "";
    Trainer whole(context, dataset, options, folder.path() / (name + "whole"));
    const TrainSummary summary = whole.run(false);
    CHECK(summary.iterations == 60);
    CHECK(summary.evaluations.back().psnr > 14);
    Trainer part(context, dataset, options, folder.path() / (name + "part"));
    part.step(23);
    part.save();
    Trainer rest(context, dataset, options, folder.path() / (name + "rest"));
    rest.resume(folder.path() / (name + "part"));
    rest.run(false);
    check_equal(rest.model(), whole.model());
    options.views_per_step = 2;
    Trainer other(context, dataset, options, folder.path() / (name + "other"));
    CHECK_THROWS_AS(other.resume(folder.path() / (name + "part")), UsageError);
  }
}
