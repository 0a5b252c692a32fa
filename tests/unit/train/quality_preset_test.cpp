// SPDX-License-Identifier: Apache-2.0
#include "train/quality_preset.hpp"

#include <doctest/doctest.h>

#include <optional>

#include "raysplats/error.hpp"

using namespace raysplats;

TEST_CASE("higher qualities train longer on larger photos, within the capture's own size [tiny]") {
  Dataset dataset;
  dataset.views.resize(60);
  for (View& view : dataset.views) view.camera.width = 1920, view.camera.height = 1080;
  dataset.views.back().test = true;
  QualityChoice before{0, 1000};
  for (const std::string& name : quality_names()) {
    CAPTURE(name);
    const QualityChoice cpu = choose_quality(parse_quality(name), dataset, DeviceType::kCpu);
    const QualityChoice gpu = choose_quality(parse_quality(name), dataset, DeviceType::kGpu);
    CHECK(cpu.iterations > before.iterations);
    CHECK(cpu.downscale < before.downscale);
    CHECK(gpu.downscale <= cpu.downscale);
    CHECK(gpu.downscale >= 1);
    CHECK(gpu.iterations == cpu.iterations);
    before = cpu;
  }
  CHECK(choose_quality(Quality::kLow, dataset, DeviceType::kCpu).downscale == 5);
  // Twelve passes over 59 photos are below the least.
  CHECK(choose_quality(Quality::kLow, dataset, DeviceType::kCpu).iterations == 1000);
  dataset.views.resize(240);
  for (View& view : dataset.views) view.camera.width = 1920, view.camera.height = 1080;
  CHECK(choose_quality(Quality::kLow, dataset, DeviceType::kCpu).iterations == 12 * 239);
  // Few photos are known by heart early, whatever the level.
  dataset.views.resize(24);
  CHECK(choose_quality(Quality::kMedium, dataset, DeviceType::kCpu).iterations == 2400);
  CHECK(choose_quality(Quality::kHigh, dataset, DeviceType::kCpu).iterations == 120 * 24);
  CHECK_THROWS_AS(parse_quality("best"), UsageError);
  // One large photo among small ones says nothing of them.
  for (View& view : dataset.views) view.camera.width = 135, view.camera.height = 240;
  dataset.views[3].camera.width = 2160, dataset.views[3].camera.height = 3840;
  CHECK(choose_quality(Quality::kLow, dataset, DeviceType::kCpu).downscale == 1);
}

TEST_CASE("large photos are reduced to a size that trainers expect, or that a time allows [tiny]") {
  Dataset dataset;
  dataset.views.resize(9);
  const auto sized = [&](int width, int height) {
    for (View& view : dataset.views) view.camera.width = width, view.camera.height = height;
  };
  const auto factor = [&](std::optional<double> seconds = std::nullopt,
                          DeviceType device = DeviceType::kCpu) {
    return fitting_downscale(dataset, device, seconds);
  };
  sized(3000, 4000);
  CHECK(factor() == 2.5);
  CHECK(factor(std::nullopt, DeviceType::kGpu) == 2.5);
  CHECK(factor(3600.0) == 2.5);
  CHECK(factor(100.0) == 4.0);
  CHECK(factor(100.0, DeviceType::kGpu) == 2.5);
  CHECK(factor(5.0) == 6.25);
  // One large photo among small ones says nothing of them, and a little is not worth blurring.
  sized(1920, 1080);
  dataset.views[4].camera.width = 8000;
  CHECK(factor() == 1.0);
  // A strip keeps as many pixels as others, not a height of nothing.
  sized(16000, 2000);
  CHECK(factor() == 5.0);
  CHECK(choose_quality(Quality::kHigh, dataset, DeviceType::kCpu).downscale == 5);
  sized(2000, 16000);
  CHECK(factor() == 5.0);
  sized(8000, 4000);
  CHECK(factor() == 5.0);
  sized(480, 270);
  CHECK(factor(5.0) == 1.0);
  CHECK(factor(1.0) == 1.0);
}
