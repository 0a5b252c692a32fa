// SPDX-License-Identifier: Apache-2.0
#include "device/kernel_sample.hpp"

#include "device/context_impl.hpp"

namespace raysplats {

KernelSample::KernelSample(Context& context) : context_(context) {
  Context::Impl& impl = context.impl();
  const auto properties = impl.queue.getInfo<CL_QUEUE_PROPERTIES>();
  impl.sampled = alone_ = !impl.options.profile && (properties & CL_QUEUE_PROFILING_ENABLE) != 0;
}

KernelSample::~KernelSample() { context_.impl().sampled = false; }

}  // namespace raysplats
