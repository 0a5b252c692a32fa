// SPDX-License-Identifier: Apache-2.0
#include "train/quality_preset.hpp"

#include <doctest/doctest.h>

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
