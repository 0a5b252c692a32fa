// SPDX-License-Identifier: Apache-2.0
#include "device/foreign_opencl.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>

#include "device/context_impl.hpp"
#include "device/platform.hpp"
#include "raysplats/error.hpp"

namespace raysplats {
namespace {

// The memory of a caller's buffer as one of ours, checked.
cl::Buffer checked_memory(Context& context, cl_mem memory, std::size_t bytes, const char* what) {
  if (memory == nullptr) throw UsageError(fmt::format("The buffer of {} is missing", what));
  cl::Buffer buffer(memory, true);
  if (buffer.getInfo<CL_MEM_CONTEXT>()() != context.impl().context()) {
    throw UsageError(fmt::format(
        "The buffer of {} belongs to another cl_context than the queue: make it with that of the "
        "queue",
        what));
  }
  const std::size_t size = buffer.getInfo<CL_MEM_SIZE>();
  if (size < bytes) {
    throw UsageError(
        fmt::format("The buffer of {} has {} bytes, {} are needed", what, size, bytes));
  }
  return buffer;
}

void copy(Context& context, const cl::Buffer& from, const cl::Buffer& to, std::size_t bytes) {
  if (bytes > 0) context.impl().queue.enqueueCopyBuffer(from, to, 0, 0, bytes);
}

}  // namespace

std::unique_ptr<Context> adopt_queue(cl_command_queue queue, const ContextOptions& options) try {
  if (queue == nullptr) throw UsageError("There is no command queue: make one first");
  const cl::CommandQueue own(queue, true);
  const cl_command_queue_properties properties = own.getInfo<CL_QUEUE_PROPERTIES>();
  if ((properties & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE) != 0)
    throw UsageError("The command queue is out of order: make one in order");
  if (options.profile && (properties & CL_QUEUE_PROFILING_ENABLE) == 0)
    throw UsageError("The command queue takes no times: make one with CL_QUEUE_PROFILING_ENABLE");
  const cl::Device device = own.getInfo<CL_QUEUE_DEVICE>();
  for (const PlatformDevice& known : platform_devices()) {
    if (known.device() != device()) continue;
    if (!known.info.usable()) {
      throw DeviceError(fmt::format("The queue's device {} is not usable: {}", known.info.name,
                                    fmt::join(known.info.problems, ", ")));
    }
    auto context = std::make_unique<Context>(known.info, options);
    context->impl().context = own.getInfo<CL_QUEUE_CONTEXT>();
    context->impl().queue = own;
    context->impl().device = device;
    return context;
  }
  throw DeviceError("The queue's device is none of list_devices()");
} catch (const cl::Error& error) {
  throw_cl_error(error, "Taking over a command queue");
}

cl_command_queue queue_of(Context& context) { return context.impl().queue(); }

void check_foreign(Context& context, cl_mem memory, std::size_t bytes, const char* what) try {
  checked_memory(context, memory, bytes, what);
} catch (const cl::Error& error) {
  throw_cl_error(error, fmt::format("Looking at the buffer of {}", what));
}

void copy_in(Context& context,
             cl_mem source,
             const RawBuffer& target,
             std::size_t bytes,
             const char* what) try {
  copy(context, checked_memory(context, source, bytes, what), target.impl()->buffer, bytes);
} catch (const cl::Error& error) {
  throw_cl_error(error, fmt::format("Copying {} into the library", what));
}

void copy_out(Context& context,
              const RawBuffer& source,
              cl_mem target,
              std::size_t bytes,
              const char* what) try {
  copy(context, source.impl()->buffer, checked_memory(context, target, bytes, what), bytes);
} catch (const cl::Error& error) {
  throw_cl_error(error, fmt::format("Copying {} out of the library", what));
}

}  // namespace raysplats
