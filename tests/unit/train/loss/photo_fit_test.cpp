// SPDX-License-Identifier: Apache-2.0
#include "train/loss/photo_fit.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "train/optimizer/step_guard.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;

TEST_CASE("the fit of a photo is that of its last step at full size [small]") {
  Context context = make_test_context();
  // More sums than are kept of a photo.
  std::vector<std::array<float, 4>> parts(150);
  double error = 0, weight = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    parts[i] = {9.0f, 0.001f * static_cast<float>(i + 1), 48.0f, 7.0f};
    error += static_cast<double>(parts[i][1]);
    weight += 48.0;
  }
  Buffer<std::array<float, 4>> pixel(context, parts.size(), "pixel sums");
  pixel.upload(parts);
  Buffer<float> ssim(context, 1, "SSIM sums");
  const ImageLoss::Partials loss{pixel, ssim, static_cast<int>(parts.size()), 1};
  Buffer<std::uint32_t> overflow(context, 1, "overflow");
  overflow.clear();
  Buffer<std::uint32_t> capped(context, 2, "capped");
  capped.clear();
  StepGuard guard(context);
  PhotoFit fit(context, 3);
  const auto note = [&](std::size_t view, bool full_size) {
    guard.check_view(loss, overflow, {capped, 0, true}, fit.place(view, full_size), true);
  };
  note(1, true);
  const double expected = 10.0 * std::log10(weight / error);
  CHECK(fit.psnr()[1] == doctest::Approx(expected).epsilon(1e-5));
  CHECK(std::isnan(fit.psnr()[0]));
  // A step without room says nothing, and one of another size is not compared.
  for (std::array<float, 4>& part : parts) part[1] *= 10;
  pixel.upload(parts);
  overflow.upload(std::array<std::uint32_t, 1>{1});
  note(1, true);
  CHECK(fit.psnr()[1] == doctest::Approx(expected).epsilon(1e-5));
  overflow.clear();
  note(2, true);
  CHECK(fit.psnr()[2] == doctest::Approx(expected - 10.0).epsilon(1e-5));
  note(1, false);
  CHECK(std::isnan(fit.psnr()[1]));
  fit.forget();
  CHECK(std::isnan(fit.psnr()[2]));
}
