// SPDX-License-Identifier: Apache-2.0
#include "trace/gradient_sums.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace raysplats {
namespace {

constexpr std::size_t kRoundGroup = 64;

}  // namespace

GradientSumChoice GradientSumChoice::of(const TraceOptions& options,
                                        const DeviceInfo& device,
                                        std::size_t lines,
                                        std::size_t room,
                                        std::size_t copies_per_unit) {
  // CPUs add to private copies: no atomics and the same sum every time. GPUs have too many groups
  // for that.
  GradientSumChoice out;
  out.sum = options.gradient_sum;
  if (out.sum == GradientSum::kAuto) {
    const GradientSum shared = options.deterministic ? GradientSum::kExact : GradientSum::kAtomic;
    out.sum = device.type == DeviceType::kCpu ? GradientSum::kCopies : shared;
  }
  if (out.sum != GradientSum::kCopies) return out;
  const std::size_t units = std::max<std::size_t>(device.compute_units, 1);
  const std::size_t copy = std::max<std::size_t>(lines, 1) * sizeof(GradientSums::Line);
  const std::size_t fit =
      std::min<std::size_t>(std::max(room, kExactCopies * copy), device.max_allocation) / copy;
  if (fit < units) {
    out.sum = GradientSum::kExact;
    out.crowded_out = true;
  } else {
    out.copies = std::clamp(room / copy, units, std::min(copies_per_unit * units, fit));
  }
  return out;
}

BuildOptions& GradientSumChoice::define(BuildOptions& build, const DeviceInfo& device) const {
  const bool native = sum == GradientSum::kAtomic;
  if (native && device.has_float_atomics) build.language("CL3.0");
  return build.define("PRIVATE_COPIES", sum == GradientSum::kCopies ? 1 : 0)
      .define("EXACT_SUMS", sum == GradientSum::kExact ? 1 : 0)
      .define("FLOAT_ATOMICS", native ? 1 : 0);
}

GradientSums::GradientSums(Context& context, std::string label)
    : context_(&context), label_(std::move(label)) {}

void GradientSums::prepare(const GradientSumChoice& choice, std::size_t count) {
  choice_ = choice;
  count_ = count;
  if (choice.crowded_out && !std::exchange(told_, true)) {
    const std::size_t units = std::max<std::size_t>(context_->device().compute_units, 1);
    spdlog::info(
        "{}: a private copy for each of {} compute units takes {:.1f} MiB, more than their share "
        "of memory-budget or than one buffer may have: exact sums are taken, which are slower",
        label_, units, static_cast<double>(units * count * sizeof(Line)) / (1 << 20));
  }
  const bool tidy = tidy_copies_ == std::array<std::size_t, 2>{count, choice.copies};
  tidy_copies_ = {};
  lines_.ensure(*context_, count * choice.copies, label_);
  if (!is_exact()) {
    lines_.clear(tidy ? count : count * choice.copies);
    return;
  }
  const std::size_t size = count * RS_EXACT_WORDS;
  const bool ready = tidy_exact_ == count && exact_.size() == size;
  tidy_exact_ = 0;
  exact_.ensure(*context_, size, "exact " + label_);
  if (!ready) exact_.fill(RS_EXACT_BIAS);
}

float GradientSums::limit(std::size_t addends) {
  return std::ldexp(1.0f, RS_EXACT_HIGH) / static_cast<float>(std::max<std::size_t>(addends, 1));
}

void GradientSums::round() {
  if (!is_exact()) return;
  context_->kernel("trace/gradient_sums.cl", "round_exact_lines")
      .launch(Range::linear(count_, kRoundGroup), static_cast<std::uint32_t>(count_),
              BufferAs<std::uint32_t>{exact_.raw()}, lines_);
  tidy_exact_ = count_;
}

void GradientSums::settle() { tidy_copies_ = {count_, choice_.copies}; }

}  // namespace raysplats
