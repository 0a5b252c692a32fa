// SPDX-License-Identifier: Apache-2.0
#include "train/image_loss.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "raysplats/error.hpp"
#include "train/lanes.hpp"

namespace raysplats {
namespace {

// As in cl/train/ssim_window.h.
constexpr int kPad = 16;
constexpr int kRadius = 5;
constexpr std::size_t kFoldItems = 64;

}  // namespace

struct ImageLoss::Impl {
  using Sums = std::array<float, 4>;

  Context& context;
  float ssim_weight;
  int tile;
  int rows;
  bool serial;  // one work-item per group: work-items are long and nothing is gained by grouping
                // them
  Kernel prepare, slopes_kernel, gradient_kernel, fold;
  Buffer<float> pair, slopes, ssim_partials;
  Buffer<Sums> pixel_partials, sums;
  int width = 0;
  int height = 0;
  int stride = 0;
  int plane = 0;

  Impl(Context& owner, PixelLoss pixel_loss, float weight, int vector)
      : context(owner), ssim_weight(weight), serial(owner.device().type == DeviceType::kCpu) {
    if (!(weight >= 0.0f && weight <= 1.0f)) {
      throw UsageError(
          fmt::format("The weight of SSIM in the loss is {}; give a value from 0 to 1", weight));
    }
    tile = serial ? 128 : 16;
    rows = serial ? 8 : 1;
    BuildOptions build;
    build.define("VECTOR", lane_count(owner.device(), vector))
        .define("TILE", tile)
        .define("ROWS", rows);
    build.define("PIXEL_L2", pixel_loss == PixelLoss::kL2 ? 1 : 0);
    prepare = owner.kernel("train/loss_prepare.cl", "prepare_pair", build);
    build.define("SSIM_GRADIENT", weight > 0.0f ? 1 : 0);
    slopes_kernel = owner.kernel("train/loss_ssim.cl", "ssim_slopes", build);
    gradient_kernel = owner.kernel("train/loss_ssim.cl", "loss_gradient", build);
    fold = owner.kernel("train/loss_reduce.cl", "fold_loss");
    sums = Buffer<Sums>(owner, kFoldItems, "loss sums");
  }

  std::size_t tiles_x() const { return static_cast<std::size_t>((width + tile - 1) / tile); }
  std::size_t tiles_y() const { return static_cast<std::size_t>((height + rows - 1) / rows); }

  // The kernels never write the borders, so they are cleared when the layout changes only.
  void resize(int new_width, int new_height) {
    if (new_width == width && new_height == height) return;
    width = new_width;
    height = new_height;
    // An odd number of 64-byte lines per row keeps the 11 rows of a window in different cache sets.
    stride = (((width + 15) / 16 + 2 * kPad / 16) | 1) * 16;
    const std::size_t size =
        static_cast<std::size_t>(stride) * static_cast<std::size_t>(height + 2 * kRadius);
    if (9 * size > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
      throw ResourceError(fmt::format(
          "An image of {}x{} is too large for the loss; use --downscale", width, height));
    }
    plane = static_cast<int>(size);
    pair.ensure(context, 6 * size, "loss image pair");
    pair.clear();
    if (ssim_weight > 0.0f) {
      slopes.ensure(context, 9 * size, "loss SSIM slopes");
      slopes.clear();
    } else {
      slopes.ensure(context, 1, "loss SSIM slopes");
    }
    pixel_partials.ensure(context, tiles_x() * tiles_y(), "loss pixel sums");
    ssim_partials.ensure(context, 3 * tiles_x() * tiles_y(), "loss SSIM sums");
  }
};

ImageLoss::ImageLoss(Context& context, PixelLoss pixel_loss, float ssim_weight, int vector)
    : impl_(std::make_unique<Impl>(context, pixel_loss, ssim_weight, vector)) {}
ImageLoss::~ImageLoss() = default;

void ImageLoss::evaluate(const Buffer<float>& image,
                         const Buffer<std::uint32_t>& target,
                         bool alpha_is_background,
                         std::array<float, 3> background,
                         int width,
                         int height,
                         Buffer<float>& gradient) {
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (width <= 0 || height <= 0 || image.size() < 4 * pixels || target.size() < pixels) {
    throw UsageError(
        fmt::format("The loss of a {}x{} image was given buffers of {} floats and {} pixels", width,
                    height, image.size(), target.size()));
  }
  Impl& s = *impl_;
  s.resize(width, height);
  gradient.ensure(s.context, 4 * pixels, "image gradient");

  const bool weighted = alpha_is_background && target.size() >= 2 * pixels;
  Range range{{s.tiles_x(), s.tiles_y(), 1}, {0, 0, 0}};
  if (s.serial) range.local = {1, 1, 1};
  s.prepare.launch(range, image, target, s.pair, s.pixel_partials, width, height, s.stride, s.plane,
                   alpha_is_background ? (weighted ? 2 : 1) : 0, background[0], background[1],
                   background[2]);
  range.global[2] = 3;
  s.slopes_kernel.launch(range, s.pair, s.slopes, s.ssim_partials, width, height, s.stride,
                         s.plane);
  const float share = 1.0f / (3.0f * static_cast<float>(pixels));
  s.gradient_kernel.launch(range, s.pair, s.slopes, target, gradient, width, height, s.stride,
                           s.plane, alpha_is_background ? (weighted ? 2 : 0) : 1,
                           (1.0f - s.ssim_weight) * share, -s.ssim_weight * share);
}

ImageLoss::Partials ImageLoss::partials() const {
  const Impl& s = *impl_;
  return {s.pixel_partials, s.ssim_partials, static_cast<int>(s.tiles_x() * s.tiles_y())};
}

ImageLoss::Value ImageLoss::value() {
  Impl& s = *impl_;
  if (s.width == 0) throw UsageError("The loss has no value before an image was evaluated");
  s.fold.launch(Range{{kFoldItems, 1, 1}, {0, 0, 0}}, s.pixel_partials, s.ssim_partials, s.sums,
                static_cast<int>(s.tiles_x() * s.tiles_y()));
  std::array<double, 4> total{};
  for (const Impl::Sums& part : s.sums.download()) {
    for (std::size_t i = 0; i < total.size(); ++i) total[i] += static_cast<double>(part[i]);
  }
  const double samples = 3.0 * s.width * s.height;
  Value value;
  value.pixel = total[0] / samples;
  value.ssim = total[3] / samples;
  value.total = (1.0 - static_cast<double>(s.ssim_weight)) * value.pixel +
                static_cast<double>(s.ssim_weight) * (1.0 - value.ssim);
  value.psnr = total[1] > 0 ? 10.0 * std::log10(total[2] / total[1])
                            : std::numeric_limits<double>::infinity();
  return value;
}

}  // namespace raysplats
