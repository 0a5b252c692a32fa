// SPDX-License-Identifier: Apache-2.0
#include "device/launch_timer.hpp"

#include <chrono>
#include <optional>
#include <vector>

#include "device/context_impl.hpp"

namespace raysplats {
namespace {

constexpr const char* kWhat = "Timing launches";

}  // namespace

using Time = std::chrono::steady_clock::time_point;

struct LaunchTimer::Impl {
  Context* owner;
  Context::Impl* context;
  std::vector<cl::Event> events;
  std::optional<Time> begin;  // of a queue that takes no times
  double host_seconds = 0;

  // Further launches are not timed.
  void release() {
    if (context->timed_events == &events) context->timed_events = nullptr;
  }
};

LaunchTimer::LaunchTimer(Context& context)
    : impl_(std::make_unique<Impl>(Impl{&context, &context.impl(), {}, {}, 0})) {
  const auto properties = impl_->context->queue.getInfo<CL_QUEUE_PROPERTIES>();
  if ((properties & CL_QUEUE_PROFILING_ENABLE) != 0) {
    impl_->context->timed_events = &impl_->events;
  } else {
    context.finish();
    impl_->begin = std::chrono::steady_clock::now();
  }
}
LaunchTimer::~LaunchTimer() {
  if (impl_) impl_->release();
}
LaunchTimer::LaunchTimer(LaunchTimer&&) noexcept = default;
LaunchTimer& LaunchTimer::operator=(LaunchTimer&&) noexcept = default;

void LaunchTimer::stop() {
  impl_->release();
  if (!impl_->begin) return;
  impl_->owner->finish();
  impl_->host_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - *impl_->begin).count();
}

bool LaunchTimer::ready() const {
  try {
    return impl_->events.empty() || is_over(impl_->events.back());
  } catch (const cl::Error& error) {
    throw_cl_error(error, kWhat);
  }
}

double LaunchTimer::seconds() const {
  if (impl_->begin) return impl_->host_seconds;
  if (impl_->events.empty()) return 0;
  if (!ready()) ++impl_->context->host_waits;
  try {
    impl_->events.back().wait();
    const std::uint64_t begin =
        impl_->events.front().getProfilingInfo<CL_PROFILING_COMMAND_START>();
    const std::uint64_t end = impl_->events.back().getProfilingInfo<CL_PROFILING_COMMAND_END>();
    return end > begin ? 1e-9 * static_cast<double>(end - begin) : 0.0;
  } catch (const cl::Error& error) {
    throw_cl_error(error, kWhat);
  }
}

}  // namespace raysplats
