// SPDX-License-Identifier: Apache-2.0
#include "train/loss/photo_fit.hpp"

#include <cmath>
#include <limits>

#include "shared/train_layout.h"

namespace raysplats {

PhotoFit::PhotoFit(Context& context, std::size_t views)
    : sums_(context, RS_FIT_ITEMS * views, "fit of photos"), full_size_(views) {
  sums_.clear();
}

PhotoFit::Place PhotoFit::place(std::size_t view, bool full_size) {
  full_size_[view] = full_size;
  return {sums_, full_size ? static_cast<std::int32_t>(view) : -1};
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
