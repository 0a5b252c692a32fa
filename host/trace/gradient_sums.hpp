// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "device/buffer.hpp"
#include "device/build_options.hpp"
#include "device/context.hpp"
#include "raysplats/device.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/exact_sum.h"

namespace raysplats {

/// How the gradients of many rays are added (TraceOptions::gradient_sum and ::deterministic on a
/// device), with kAuto decided.
struct GradientSumChoice {
  /// Copies of packets' gradients for each compute unit: more share the tiles out more evenly.
  static constexpr std::size_t kPacketCopies = 2;
  /// What exact sums take, in copies: their words, and the lines that they are rounded to.
  static constexpr std::size_t kExactCopies = RS_EXACT_WORDS + 1;

  GradientSum sum = GradientSum::kCopies;  ///< never kAuto
  std::size_t copies = 1;                  ///< more than one with kCopies only
  bool crowded_out = false;                ///< copies were wanted and kExact took their place

  /// The choice for `lines` lines of 16 floats. Copies may take `room` bytes in all, or what exact
  /// sums would: `copies_per_unit` for each compute unit where `room` holds them, at least one;
  /// where those do not fit the choice is kExact.
  static GradientSumChoice of(const TraceOptions& options,
                              const DeviceInfo& device,
                              std::size_t lines,
                              std::size_t room,
                              std::size_t copies_per_unit);
  /// Build options PRIVATE_COPIES, EXACT_SUMS and FLOAT_ATOMICS, and the language that takes.
  BuildOptions& define(BuildOptions& build, const DeviceInfo& device) const;
};

/// Sums of gradients in lines of 16 floats (cl/trace/line_sum.h). A pass is: prepare(); kernels
/// that add to target(), built with define(); round(); a kernel that reads lines(), takes the
/// copies together in a fixed order and leaves zeros in all but the first; settle().
class GradientSums {
 public:
  using Line = std::array<float, 16>;

  /// `label` names the buffers.
  GradientSums(Context& context, std::string label);

  /// Zeros for `count` lines and each of their copies. Throws ResourceError where they do not fit
  /// the device. Tells the log once where exact sums took the place of copies.
  void prepare(const GradientSumChoice& choice, std::size_t count);
  /// GradientSumChoice::define() of the choice.
  BuildOptions& define(BuildOptions& build) const {
    return choice_.define(build, context_->device());
  }
  /// The largest absolute value that an exact sum may take in so often without leaving its range;
  /// what is larger makes it NaN.
  static float limit(std::size_t addends);
  /// What the kernels add to: lines, or the integers of exact sums.
  const Buffer<Line>& target() const { return is_exact() ? exact_ : lines_; }
  /// Rounds exact sums to floats.
  void round();
  const Buffer<Line>& lines() const { return lines_; }
  /// The copies behind the first hold zeros again: the next prepare() need not write them.
  void settle();

  bool is_private() const { return choice_.sum == GradientSum::kCopies; }
  bool is_exact() const { return choice_.sum == GradientSum::kExact; }
  std::size_t copies() const { return choice_.copies; }
  const GradientSumChoice& choice() const { return choice_; }

 private:
  Context* context_;
  std::string label_;
  GradientSumChoice choice_;
  std::size_t count_ = 0;
  Buffer<Line> lines_;
  Buffer<Line> exact_;
  std::size_t tidy_exact_ = 0;                // lines whose exact sums are ready
  std::array<std::size_t, 2> tidy_copies_{};  // lines and copies of which all but one hold zeros
  bool told_ = false;                         // that copies were crowded out
};

}  // namespace raysplats
