// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raysplats {

class Context;

/// Times all launches of a context while it lives, for Context::profiler(), as
/// ContextOptions::profile does for good. Nothing waits for them; on a queue that takes no times
/// it does nothing. Not two at once.
class KernelSample {
 public:
  explicit KernelSample(Context& context);
  ~KernelSample();
  KernelSample(const KernelSample&) = delete;
  KernelSample& operator=(const KernelSample&) = delete;

  /// Whether launches are timed because of it, not for good or not at all.
  bool alone() const { return alone_; }

 private:
  Context& context_;
  bool alone_;
};

}  // namespace raysplats
