// SPDX-License-Identifier: Apache-2.0
#include "trace/sky.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"
#include "trace/camera_rays.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kBlock = 256;  // as in cl/trace/sky.cl
constexpr std::size_t kMaxDegree = 4;

// -1 for a number of coefficients that no degree has.
int degree_of(std::size_t coefficients) {
  for (std::size_t degree = 0; degree <= kMaxDegree; ++degree) {
    if (coefficients == (degree + 1) * (degree + 1)) return static_cast<int>(degree);
  }
  return -1;
}

SkyLight by_coefficient(const std::vector<float>& numbers) {
  SkyLight out(numbers.size() / 3);
  for (std::size_t i = 0; i < numbers.size(); ++i) out[i / 3][i % 3] = numbers[i];
  return out;
}

}  // namespace

void check_sky(const SkyLight& light) {
  if (degree_of(light.size()) < 0) {
    throw UsageError(fmt::format(
        "A sky of {} coefficients has no degree: give 1, 4, 9, 16 or 25 of them", light.size()));
  }
  for (const auto& coefficient : light) {
    for (const float value : coefficient) {
      if (!std::isfinite(value))
        throw UsageError("A sky has a coefficient that is not finite: give numbers");
    }
  }
}

void check_background(const std::array<float, 3>& background) {
  for (const float value : background) {
    if (std::isfinite(value)) continue;
    throw UsageError(
        fmt::format("The background {}, {}, {} has a number that is not finite: give a colour",
                    background[0], background[1], background[2]));
  }
}

Sky::Sky(Context& context, const SkyLight& light)
    : context_(context), degree_((check_sky(light), degree_of(light.size()))) {
  std::vector<float> numbers;
  for (const auto& coefficient : light)
    numbers.insert(numbers.end(), coefficient.begin(), coefficient.end());
  coefficients_ = Buffer<float>(context, numbers.size(), "sky");
  coefficients_.upload(numbers);
  gradient_ = Buffer<float>(context, numbers.size(), "sky gradient");
  gradient_.clear();
}

Kernel Sky::kernel(const char* name, const Camera& camera) const {
  return context_.kernel("trace/sky.cl", name,
                         BuildOptions()
                             .define("CAMERA_MODEL", camera_model_number(camera.model))
                             .define("SKY_DEGREE", degree_));
}

void Sky::show(const Camera& camera, const Buffer<float>& image) {
  const std::size_t pixels = pixel_count(camera);
  kernel("show_sky", camera)
      .launch(Range::linear(pixels, kGroup), lens_camera(camera, Lens{}), coefficients_,
              static_cast<std::uint32_t>(pixels), image);
}

const Buffer<float>& Sky::backward(const Camera& camera,
                                   const Buffer<float>& image,
                                   const Buffer<float>& image_gradient) {
  const std::size_t pixels = pixel_count(camera);
  const std::size_t blocks = (pixels + kBlock - 1) / kBlock;
  image_gradient_.ensure(context_, 4 * pixels, "gradient over black");
  image_gradient_.copy_from(image_gradient, 4 * pixels);
  partials_.ensure(context_, blocks * coefficients_.size(), "sky sums");
  kernel("sky_gradient", camera)
      .launch(Range::linear(blocks, kGroup), lens_camera(camera, Lens{}), coefficients_,
              static_cast<std::uint32_t>(pixels), image, image_gradient_, partials_);
  kernel("sum_sky", camera)
      .launch(Range::linear(coefficients_.size(), kGroup), partials_,
              static_cast<std::uint32_t>(blocks), gradient_);
  return image_gradient_;
}

void Sky::set(std::span<const float> coefficients) {
  if (coefficients.size() != coefficients_.size()) {
    throw UsageError(fmt::format("A sky of {} numbers cannot take {}: give as many as it has",
                                 coefficients_.size(), coefficients.size()));
  }
  coefficients_.upload(coefficients);
}

SkyLight Sky::light() const { return by_coefficient(coefficients_.download()); }
SkyLight Sky::download_gradient() const { return by_coefficient(gradient_.download()); }

}  // namespace raysplats
