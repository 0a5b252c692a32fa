// SPDX-License-Identifier: Apache-2.0
#include "train/loss/image_loss.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"
#include "shared/train_layout.h"
#include "train/optimizer/lanes.hpp"

namespace raysplats {
namespace {

// As in cl/train/ssim_window.h.
constexpr int kPad = 16;
constexpr int kRadius = 5;
constexpr std::size_t kFoldItems = 64;
// Work-items along the side of a group of cl/train/group_loss.cl, and the local memory it takes.
constexpr int kSide = 16;
constexpr std::uint64_t kGroupLocalMemory = 14336;

bool takes_groups(const DeviceInfo& device) {
  return device.max_work_group_size >= kSide * kSide && device.local_memory >= kGroupLocalMemory;
}

}  // namespace

struct ImageLoss::Impl {
  using Sums = std::array<float, 4>;

  Context& context;
  float ssim_weight;
  float alpha_weight;
  bool grouped;  // a work-group per tile and channel, a work-item per pixel
  bool serial;   // one work-item per group: work-items are long and nothing is gained by grouping
                 // them
  int tile;
  int rows;
  Kernel prepare, derivatives_kernel, gradient_kernel, fold;
  Buffer<float> pair, derivatives, ssim_partials;
  Buffer<Sums> pixel_partials, sums;
  int width = 0;
  int height = 0;
  // Row and size of the padded planes of work-items that take tiles.
  int stride = 0;
  int plane = 0;
  bool laid_out = false;  // whether all buffers are for an image of this size

  Impl(Context& owner, PixelLoss pixel_loss, Weights weights, int vector)
      : context(owner),
        ssim_weight(weights.ssim),
        alpha_weight(weights.alpha),
        grouped(vector == kGroups || (vector == 0 && owner.device().type != DeviceType::kCpu &&
                                      takes_groups(owner.device()))),
        serial(!grouped && owner.device().type == DeviceType::kCpu),
        tile(serial ? 128 : kSide),
        rows(serial ? 8 : (grouped ? kSide : 1)) {
    if (!(ssim_weight >= 0.0f && ssim_weight <= 1.0f)) {
      throw UsageError(fmt::format("The weight of SSIM in the loss is {}; give a value from 0 to 1",
                                   ssim_weight));
    }
    if (!(alpha_weight >= 0.0f)) {
      throw UsageError(
          fmt::format("The weight of coverage in the loss is {}; give a value that is not negative",
                      alpha_weight));
    }
    if (grouped && !takes_groups(owner.device())) {
      throw DeviceError(fmt::format(
          "{} has {} work-items and {} bytes of local memory a work-group, the loss in groups "
          "needs {} and {}",
          owner.device().name, owner.device().max_work_group_size, owner.device().local_memory,
          kSide * kSide, kGroupLocalMemory));
    }
    BuildOptions build;
    build.define("PIXEL_L2", pixel_loss == PixelLoss::kL2 ? 1 : 0);
    if (!grouped) {
      build.define("LANES", lane_count(owner.device(), vector))
          .define("TILE", tile)
          .define("ROWS", rows);
      prepare = owner.kernel("train/loss_prepare.cl", "prepare_pair", build);
    }
    build.define("SSIM_GRADIENT", ssim_weight > 0.0f ? 1 : 0);
    const char* program = grouped ? "train/group_loss.cl" : "train/loss_ssim.cl";
    derivatives_kernel =
        owner.kernel(program, grouped ? "group_ssim_derivatives" : "ssim_derivatives", build);
    gradient_kernel = owner.kernel(program, grouped ? "group_gradient" : "loss_gradient", build);
    fold = owner.kernel("train/loss_reduce.cl", "fold_loss");
    sums = Buffer<Sums>(owner, kFoldItems, "loss sums");
  }

  std::size_t tiles_x() const { return static_cast<std::size_t>((width + tile - 1) / tile); }
  std::size_t tiles_y() const { return static_cast<std::size_t>((height + rows - 1) / rows); }
  std::size_t ssim_sums() const { return 3 * tiles_x() * tiles_y(); }
  std::size_t pixel_sums() const { return grouped ? ssim_sums() : tiles_x() * tiles_y(); }

  void resize(int new_width, int new_height) {
    if (laid_out && new_width == width && new_height == height) return;
    laid_out = false;
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
    if (!grouped) {
      // The kernels never write the borders, so they are cleared when the layout changes only.
      pair.ensure(context, 6 * size, "loss image pair");
      pair.clear();
    }
    derivatives.ensure(context, ssim_weight > 0.0f ? 9 * size : 1, "loss SSIM derivatives");
    if (ssim_weight > 0.0f && !grouped) derivatives.clear();
    pixel_partials.ensure(context, pixel_sums(), "loss pixel sums");
    ssim_partials.ensure(context, ssim_sums(), "loss SSIM sums");
    laid_out = true;
  }

  RsLoss record(const DevicePhoto& photo,
                bool alpha_is_background,
                std::array<float, 3> background) const {
    const float share = 1.0f / (3.0f * static_cast<float>(pixel_count(width, height)));
    RsLoss loss{};
    loss.width = width;
    loss.height = height;
    loss.stride = stride;
    loss.plane = plane;
    loss.planes = photo.planes;
    loss.composite = photo.composite(alpha_is_background);
    loss.red = background[0];
    loss.green = background[1];
    loss.blue = background[2];
    loss.pixel_scale = (1.0f - ssim_weight) * share;
    loss.ssim_scale = -ssim_weight * share;
    loss.alpha_scale = alpha_is_background ? alpha_weight * 3.0f * share : 0.0f;
    return loss;
  }

  void evaluate_tiles(const Buffer<float>& image,
                      const DevicePhoto& photo,
                      const RsLoss& loss,
                      Buffer<float>& gradient) {
    Range range{{tiles_x(), tiles_y(), 1}, {0, 0, 0}};
    if (serial) range.local = {1, 1, 1};
    prepare.launch(range, image, photo.words, pair, pixel_partials, loss);
    range.global[2] = 3;
    derivatives_kernel.launch(range, pair, derivatives, ssim_partials, loss);
    gradient_kernel.launch(range, image, pair, derivatives, photo.words, gradient, loss);
  }

  void evaluate_groups(const Buffer<float>& image,
                       const DevicePhoto& photo,
                       const RsLoss& loss,
                       Buffer<float>& gradient) {
    Range range = Range::plane(static_cast<std::size_t>(width), static_cast<std::size_t>(height),
                               kSide, kSide);
    range.global[2] = 3;
    derivatives_kernel.launch(range, image, photo.words, derivatives, pixel_partials, ssim_partials,
                              loss);
    gradient_kernel.launch(range, image, photo.words, derivatives, gradient, loss);
  }
};

ImageLoss::ImageLoss(Context& context, PixelLoss pixel_loss, Weights weights, int vector)
    : impl_(std::make_unique<Impl>(context, pixel_loss, weights, vector)) {}
ImageLoss::~ImageLoss() = default;

void ImageLoss::evaluate(const Buffer<float>& image,
                         const DevicePhoto& photo,
                         bool alpha_is_background,
                         std::array<float, 3> background,
                         int width,
                         int height,
                         Buffer<float>& gradient) {
  const std::size_t pixels = pixel_count(width, height);
  if (width <= 0 || height <= 0 || image.size() < 4 * pixels ||
      photo.words.size() < photo.words_of(pixels)) {
    throw UsageError(
        fmt::format("The loss of a {}x{} image was given buffers of {} floats and {} words", width,
                    height, image.size(), photo.words.size()));
  }
  Impl& s = *impl_;
  s.resize(width, height);
  gradient.ensure(s.context, 4 * pixels, "image gradient");

  const RsLoss loss = s.record(photo, alpha_is_background, background);
  if (s.grouped) {
    s.evaluate_groups(image, photo, loss, gradient);
  } else {
    s.evaluate_tiles(image, photo, loss, gradient);
  }
}

bool ImageLoss::grouped() const { return impl_->grouped; }

ImageLoss::Partials ImageLoss::partials() const {
  const Impl& s = *impl_;
  return {s.pixel_partials, s.ssim_partials, static_cast<int>(s.pixel_sums()),
          static_cast<int>(s.ssim_sums())};
}

ImageLoss::Value ImageLoss::value() {
  Impl& s = *impl_;
  if (!s.laid_out) throw UsageError("The loss has no value before an image was evaluated");
  s.fold.launch(Range{{kFoldItems, 1, 1}, {0, 0, 0}}, s.pixel_partials, s.ssim_partials, s.sums,
                static_cast<int>(s.pixel_sums()), static_cast<int>(s.ssim_sums()));
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
