// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/step_guard.hpp"

#include <doctest/doctest.h>

#include <array>
#include <limits>
#include <vector>

#include "raysplats/device.hpp"
#include "train/density/density_control.hpp"
#include "train/loss/image_loss.hpp"
#include "train/optimizer/adam.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;

namespace {

constexpr int kSide = 40;
constexpr std::size_t kPixels = kSide * kSide;

// A guard with the loss that it watches.
struct Fixture {
  Context context{test_device()};
  ImageLoss loss{context, PixelLoss::kL1, {0.2f}};
  StepGuard guard{context};
  Buffer<float> image{context, 4 * kPixels, "image"};
  Buffer<std::uint32_t> photo{context, kPixels, "photo"};
  Buffer<float> gradient;
  Buffer<std::uint32_t> refused{context, 1, "refused"};
  Buffer<std::uint32_t> overflow{context, 1, "overflow"};
  Buffer<std::uint32_t> capped{context, 3, "capped"};
  PhotoFit fit{context, 1};
  std::uint32_t refused_so_far = 0;

  Fixture() {
    photo.fill(0xff804020u);
    refused.clear();
    overflow.clear();
    capped.clear();
  }

  // A step whose picture has `value` in one pixel and in which Adam refuses `refusals` of `count`.
  void step(float value, std::uint32_t refusals = 0, std::size_t count = 5000) {
    std::vector<float> pixels(4 * kPixels, 0.5f);
    pixels[777] = value;
    image.upload(pixels);
    loss.evaluate(image, {photo}, false, {0, 0, 0}, kSide, kSide, gradient);
    look(0, true);
    marked = guard.mark().read(0) != 0;
    refused_so_far += refusals;
    refused.upload(std::array<std::uint32_t, 1>{refused_so_far});
    guard.close(refused, count);
  }
  // A view whose loss is that of the last step; its capped rays stand from word `place` on.
  void look(std::uint32_t place, bool first, bool wide = true) {
    guard.check_view(loss.partials(), overflow, {capped, place, wide}, fit.place(0, false), first);
  }
  bool marked = false;  // the last step
};

const float kNan = std::numeric_limits<float>::quiet_NaN();
const float kInfinity = std::numeric_limits<float>::infinity();

}  // namespace

TEST_CASE("steps whose loss is not finite are marked and counted, ten in a row stop the rest") {
  Fixture f;
  f.step(0.5f);
  CHECK(!f.marked);
  for (const float bad : {kNan, kInfinity, -kInfinity}) {
    f.step(bad);
    CHECK(f.marked);
  }
  CHECK(f.guard.counts().in_a_row == 3);
  f.step(0.5f);
  CHECK(!f.marked);
  CHECK(f.guard.counts().in_a_row == 0);
  CHECK(f.guard.counts().bad_steps == 3);
  for (std::uint32_t i = 1; i <= StepGuard::kLimit; ++i) {
    CHECK(!f.guard.counts().stopped);
    f.step(kNan);
    CHECK(f.guard.counts().in_a_row == i);
  }
  CHECK(f.guard.counts().stopped);
  f.step(0.5f);
  CHECK(f.marked);  // nothing changes any more
  CHECK(f.guard.counts().stopped);
  CHECK(f.guard.counts().bad_steps == 13);
}

TEST_CASE("one refused gradient in a thousand is no bad step, more are") {
  Fixture f;
  f.step(0.5f, 5, 5000);
  CHECK(f.guard.counts().bad_steps == 0);
  f.step(0.5f, 6, 5000);
  CHECK(f.guard.counts().bad_steps == 1);
  f.step(0.5f, 1, 999);
  CHECK(f.guard.counts().bad_steps == 2);
  CHECK(f.guard.counts().in_a_row == 2);
  f.step(0.5f, 0, 999);
  CHECK(f.guard.counts().in_a_row == 0);
}

TEST_CASE("counts go on from where they were") {
  Fixture f;
  f.guard.restore({9, 21, false});
  CHECK(f.guard.counts().bad_steps == 21);
  f.step(kNan);
  CHECK(f.guard.counts().in_a_row == 10);
  CHECK(f.guard.counts().stopped);
}

TEST_CASE("a marked step changes neither parameters nor moments nor statistics") {
  Context context(test_device());
  Gaussians model;
  model.resize(130);
  DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  GaussianGradients gradients;
  const auto ones = [&](Buffer<float>& buffer, std::size_t size) {
    buffer = Buffer<float>(context, size, "gradient");
    buffer.upload(std::vector<float>(size, 1.0f));
  };
  ones(gradients.means, 3 * 130);
  ones(gradients.quaternions, 4 * 130);
  ones(gradients.scales, 3 * 130);
  ones(gradients.opacities, 130);
  ones(gradients.sh, gaussians.sh.size());
  ones(gradients.screen, GaussianGradients::kScreenNumbers * 130);
  Adam adam(context, {});
  TrainOptions options;
  DensityControl density(context, options, 1.0, 1);
  const AdamRates rates{1, 1, 1, 1, 1, 1};
  adam.initialize(gaussians.count, gaussians.sh_degree);
  Buffer<std::uint32_t> guard(context, 5, "guard");
  guard.fill(1);
  density.accumulate(gaussians, gradients, &guard);
  adam.step(gaussians, gradients, rates, &guard);
  CHECK(gaussians.means.download() == model.means);
  CHECK(gaussians.opacities.download() == model.opacities);
  CHECK(adam.first_moments(ParameterGroup::kSh) == std::vector<float>(gaussians.sh.size(), 0.0f));
  CHECK(density.statistics().download() == std::vector<float>(3 * 130, 0.0f));
  guard.clear();
  density.accumulate(gaussians, gradients, &guard);
  adam.step(gaussians, gradients, rates, &guard);
  CHECK(gaussians.means.download() != model.means);
  CHECK(density.statistics().download() == std::vector<float>(3 * 130, 1.0f));
}

TEST_CASE("a step whose view had no room is marked and counts as if it had not been") {
  Fixture f;
  f.capped.upload(std::array<std::uint32_t, 2>{0xfffffff0u, 2});
  f.step(kNan);
  CHECK(f.guard.counts().bad_steps == 1);
  CHECK(f.guard.counts().capped_rays == 0x2fffffff0u);
  f.overflow.fill(1);
  for (const float value : {0.5f, kNan}) {
    f.step(value);
    CHECK(f.marked);
    CHECK(f.guard.mark().read(0) == 0);
    CHECK(f.guard.counts().in_a_row == 1);
    CHECK(f.guard.counts().bad_steps == 1);
    CHECK(f.guard.counts().capped_rays == 0x2fffffff0u);
  }
  f.overflow.clear();
  f.step(0.5f);
  CHECK(!f.marked);
  CHECK(f.guard.counts().in_a_row == 0);
  CHECK(f.guard.counts().capped_rays == 0x5ffffffe0u);  // over both words
  StepGuard resumed(f.context);
  resumed.restore(f.guard.counts());
  CHECK(resumed.counts().capped_rays == 0x5ffffffe0u);
}

TEST_CASE("the views of a step add up what the cap on hits stopped [small]") {
  Fixture f;
  f.step(0.5f);
  f.capped.upload(std::array<std::uint32_t, 3>{5, 0xfffffff0u, 7});
  f.look(1, true);
  CHECK(f.guard.step_capped() == 0x7fffffff0u);
  f.look(1, false, false);  // the next word counts something else
  CHECK(f.guard.step_capped() == 0x8ffffffe0u);
  f.guard.close(f.refused, 5000);
  CHECK(f.guard.counts().capped_rays == 0x8ffffffe0u);
  f.look(0, true, false);
  f.look(0, false, false);
  CHECK(f.guard.step_capped() == 10);
  f.guard.set_step_capped(0x300000001u);  // with those of other ranks
  f.guard.close(f.refused, 5000);
  CHECK(f.guard.counts().capped_rays == 0xbffffffe1u);
}
