// SPDX-License-Identifier: Apache-2.0
#include "train/loss/photo_fit.hpp"

#include <cmath>
#include <limits>

#include "shared/train_layout.h"

namespace raysplats {

PhotoFit::PhotoFit(Context& context, std::size_t views)
    : note_(context.kernel("train/photo_fit.cl", "note_fit")),
      sums_(context, RS_FIT_ITEMS * views, "fit of photos"),
      full_size_(views) {
  sums_.clear();
}

void PhotoFit::note(std::size_t view,
                    bool full_size,
                    const ImageLoss::Partials& loss,
                    const Buffer<std::uint32_t>& overflow) {
  full_size_[view] = full_size;
  if (!full_size) return;
  note_.launch(Range{{RS_FIT_ITEMS, 1, 1}, {0, 0, 0}, {}}, loss.pixel, loss.pixel_sums, overflow,
               static_cast<std::uint32_t>(view), sums_);
}

void PhotoFit::forget() { full_size_.assign(full_size_.size(), false); }

std::vector<double> PhotoFit::psnr() const {
  const std::vector<std::array<float, 2>> sums = sums_.download();
  std::vector<double> out(full_size_.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t view = 0; view < out.size(); ++view) {
    double error = 0, weight = 0;
    for (std::size_t k = 0; k < RS_FIT_ITEMS; ++k) {
      error += static_cast<double>(sums[RS_FIT_ITEMS * view + k][0]);
      weight += static_cast<double>(sums[RS_FIT_ITEMS * view + k][1]);
    }
    if (full_size_[view] && error > 0) out[view] = 10.0 * std::log10(weight / error);
  }
  return out;
}

}  // namespace raysplats
