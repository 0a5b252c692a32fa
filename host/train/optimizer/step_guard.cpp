// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/step_guard.hpp"

#include <array>
#include <vector>

#include "shared/train_layout.h"

namespace raysplats {
namespace {

constexpr char kProgram[] = "train/step_guard.cl";

}  // namespace

StepGuard::StepGuard(Context& context)
    : check_(context.kernel(kProgram, "guard_loss")),
      close_(context.kernel(kProgram, "guard_close")),
      state_(context, RS_GUARD_WORDS, "step guard") {
  state_.clear();
}

void StepGuard::check_view(const ImageLoss::Partials& loss,
                           const Buffer<std::uint32_t>& overflow,
                           const ViewTracer::CappedRays& capped,
                           const PhotoFit::Place& fit,
                           bool first) {
  check_.launch(Range{{RS_FIT_ITEMS, 1, 1}, {0, 0, 0}, {}}, loss.pixel, loss.ssim, loss.pixel_sums,
                loss.ssim_sums, overflow, capped.words, capped.place, capped.wide ? 1 : 0,
                first ? 1 : 0, fit.view, fit.sums, state_);
}

void StepGuard::close(const Buffer<std::uint32_t>& refused, std::size_t count) {
  close_.launch(Range{{1, 1, 1}, {1, 1, 1}, {}}, refused, u32(count), kLimit, state_);
}

void StepGuard::set_mark(std::uint32_t word) { state_.upload({&word, 1}); }

std::uint64_t StepGuard::step_capped() const {
  std::array<std::uint32_t, 2> words{};
  state_.download(words, RS_GUARD_CAPPED);
  return std::uint64_t{words[1]} << 32 | words[0];
}

void StepGuard::set_step_capped(std::uint64_t rays) {
  state_.upload(std::array<std::uint32_t, 2>{static_cast<std::uint32_t>(rays),
                                             static_cast<std::uint32_t>(rays >> 32)},
                RS_GUARD_CAPPED);
}

StepGuard::Counts StepGuard::counts() const {
  const std::vector<std::uint32_t> words = state_.download();
  return {words[1], words[2], words[3] != 0, std::uint64_t{words[6]} << 32 | words[5]};
}

void StepGuard::restore(const Counts& counts) {
  const std::uint32_t stopped = counts.stopped ? 1 : 0;
  state_.upload(std::array<std::uint32_t, RS_GUARD_WORDS>{
      stopped, counts.in_a_row, counts.bad_steps, stopped, 0,
      static_cast<std::uint32_t>(counts.capped_rays),
      static_cast<std::uint32_t>(counts.capped_rays >> 32), 0, 0});
}

}  // namespace raysplats
