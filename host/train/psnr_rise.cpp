// SPDX-License-Identifier: Apache-2.0
#include "train/psnr_rise.hpp"

#include <algorithm>

#include "eval/metrics.hpp"

namespace raysplats {
namespace {

constexpr int kViewsToJudge = 3;  // reports of views that were reported before

}  // namespace

void PsnrRise::note(std::size_t view, int divisor, double psnr) {
  const auto [first, is_new] = first_.try_emplace(std::pair(view, divisor), psnr);
  if (is_new || first->second >= kMostPsnr) return;
  most_ = std::max(most_.value_or(psnr - first->second), psnr - first->second);
  ++seen_again_;
}

std::optional<double> PsnrRise::most() const {
  return seen_again_ >= kViewsToJudge ? most_ : std::nullopt;
}

bool PsnrRise::learned_nothing() const { return most().has_value() && *most() <= kLeast; }

}  // namespace raysplats
