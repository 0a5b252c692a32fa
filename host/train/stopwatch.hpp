// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>

#include "raysplats/context.hpp"

namespace raysplats {

/// A clock that can be stopped, and stands while kernels are compiled.
class Stopwatch {
 public:
  explicit Stopwatch(const Context& context) : context_(&context) {}
  void start() {
    begun_ = std::chrono::steady_clock::now();
    built_ = context_->build_seconds();
  }
  void stop() { seconds_ = seconds(), begun_.reset(); }
  void set(double seconds) { seconds_ = seconds; }
  double seconds() const {
    if (!begun_) return seconds_;
    return seconds_ +
           std::chrono::duration<double>(std::chrono::steady_clock::now() - *begun_).count() -
           (context_->build_seconds() - built_);
  }

 private:
  const Context* context_;
  double seconds_ = 0;
  double built_ = 0;  // build_seconds() at the start
  std::optional<std::chrono::steady_clock::time_point> begun_;
};

}  // namespace raysplats
