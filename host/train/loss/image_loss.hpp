// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/train_options.hpp"
#include "train/loss/device_photo.hpp"

namespace raysplats {

/// L = (1 - lambda) * pixel + lambda * (1 - SSIM) of a rendered image and a photo, with its
/// gradient.
///
/// pixel = sum over pixels and R, G, B of m * rho(x - y), divided by 3 * width * height, where rho
/// is |.| (kL1) or the square (kL2). SSIM is the mean over all 3 * width * height window positions
/// (11 x 11 Gaussian, sigma 1.5, C1 = 0.01^2, C2 = 0.03^2, zeros beyond the borders; Wang et al.
/// 2004) of x' = y + m (x - y) and y. With an alpha a that is a mask, m = a: both means are
/// still taken over *all* pixels, so masking takes a pixel's share out of the loss and leaves the
/// weight of the others as it was; a masked pixel (m = 0) is equal in both images and contributes
/// neither value nor gradient. With alpha_is_background y = rgb * a + background * (1 - a) and m =
/// 1 everywhere, or what the photo's plane of weights says; then the gradient has the term of
/// coverage too: mu times the mean over pixels of m rho(A - a), without which a body in the colour
/// of the background is as good as none. The value leaves it out.
class ImageLoss {
 public:
  /// Where evaluate() leaves its sums: {pixel term, squared error, weight, 0} per tile or per tile
  /// and channel, and SSIM per tile and channel.
  struct Partials {
    const Buffer<std::array<float, 4>>& pixel;
    const Buffer<float>& ssim;
    int pixel_sums;
    int ssim_sums;
  };

  /// In place of a number of pixels per vector: work-groups of 16 x 16 pixels, a work-item each.
  static constexpr int kGroups = -1;

  struct Value {
    double total = 0;
    double pixel = 0;
    double ssim = 0;
    double psnr = 0;  ///< decibels over the pixels weighted by m, image clamped to [0, 1]; infinity
                      ///< when equal
  };

  /// What its terms weigh: lambda, in [0, 1], and mu.
  struct Weights {
    float ssim = 0;
    float alpha = 0;
  };

  /// `vector` is the number of pixels per vector (1, 4, 8 or 16) or kGroups; 0 = the device's own
  /// on CPUs, groups elsewhere. Throws UsageError for other values, DeviceError for groups that the
  /// device has no room for.
  ImageLoss(Context& context, PixelLoss pixel_loss, Weights weights, int vector = 0);
  ~ImageLoss();

  /// Enqueues loss and gradient. `image`: planar R, G, B, A (A is read for mu), 4 x height x width.
  /// `photo`: of the same size; its weights count with alpha_is_background. `gradient` is grown as
  /// needed and overwritten: planar dL/dR, dL/dG, dL/dB, dL/dA. Nothing is waited for.
  void evaluate(const Buffer<float>& image,
                const DevicePhoto& photo,
                bool alpha_is_background,
                std::array<float, 3> background,
                int width,
                int height,
                Buffer<float>& gradient);

  /// Loss of the last evaluate(); blocks. Sums are taken in a fixed order: equal inputs give equal
  /// values.
  Value value();

  /// Whether it works in groups of kGroups.
  bool grouped() const;

  /// Partial sums of the last evaluate().
  Partials partials() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
