// SPDX-License-Identifier: Apache-2.0
#include "device/buffer.hpp"

#include <fmt/format.h>

#include <utility>

#include "device/context_impl.hpp"
#include "raysplats/error.hpp"

namespace raysplats {

RawBuffer::Impl::~Impl() { memory->allocated -= bytes; }

RawBuffer::RawBuffer(Context& context, std::size_t bytes, const std::string& label)
    : bytes_(bytes) {
  Context::Impl& owner = context.impl();
  if (bytes > owner.info.max_allocation) {
    throw ResourceError(
        fmt::format("The buffer '{}' needs {:.1f} MiB but {} allows {:.1f} MiB at once: {}", label,
                    static_cast<double>(bytes) / (1 << 20), owner.info.name,
                    static_cast<double>(owner.info.max_allocation) / (1 << 20), kLessMemory));
  }
  try {
    owner.faults.check(Fault::kAllocation);
    const cl::Buffer buffer = owner.canaries ? owner.canaries->allocate(owner.context, owner.device,
                                                                        owner.queue, bytes, label)
                                             : cl::Buffer(owner.context, CL_MEM_READ_WRITE, bytes);
    impl_ = std::shared_ptr<Impl>(new Impl{&owner, owner.memory, buffer, bytes, label});
  } catch (const cl::Error& error) {
    throw_cl_error(error,
                   fmt::format("Allocating {:.1f} MiB for '{}' on {}",
                               static_cast<double>(bytes) / (1 << 20), label, owner.info.name));
  }
  owner.memory->add(bytes);
}

RawBuffer::Impl& RawBuffer::checked() const {
  if (!impl_) throw DeviceError("A buffer is used that was never allocated");
  return *impl_;
}

void RawBuffer::write(const void* source, std::size_t bytes, std::size_t offset) {
  Impl& impl = checked();
  ++impl.context->host_waits;
  try {
    impl.context->queue.enqueueWriteBuffer(impl.buffer, CL_TRUE, offset, bytes, source);
  } catch (const cl::Error& error) {
    throw_cl_error(error, fmt::format("Writing {} bytes to '{}'", bytes, impl.label));
  }
}

void RawBuffer::write_later(std::shared_ptr<const void> source, std::size_t bytes) {
  Impl& impl = checked();
  try {
    cl::Event event;
    impl.context->queue.enqueueWriteBuffer(impl.buffer, CL_FALSE, 0, bytes, source.get(), nullptr,
                                           &event);
    impl.context->keep_until(event, std::move(source));
  } catch (const cl::Error& error) {
    throw_cl_error(error, fmt::format("Writing {} bytes to '{}'", bytes, impl.label));
  }
}

void RawBuffer::read(void* target, std::size_t bytes, std::size_t offset) const {
  Impl& impl = checked();
  ++impl.context->host_waits;
  try {
    impl.context->queue.enqueueReadBuffer(impl.buffer, CL_TRUE, offset, bytes, target);
  } catch (const cl::Error& error) {
    throw_cl_error(error, fmt::format("Reading {} bytes from '{}'", bytes, impl.label));
  }
}

void RawBuffer::fill(std::uint32_t pattern, std::size_t bytes, std::size_t offset) {
  Impl& impl = checked();
  try {
    cl::Event event;
    impl.context->queue.enqueueFillBuffer(impl.buffer, pattern, offset, bytes, nullptr,
                                          impl.context->next_event(event));
    impl.context->timed("", "(fill)", event);
  } catch (const cl::Error& error) {
    throw_cl_error(error, fmt::format("Filling '{}'", impl.label));
  }
}

void RawBuffer::copy_from(const RawBuffer& source,
                          std::size_t bytes,
                          std::size_t source_offset,
                          std::size_t offset) {
  Impl& impl = checked();
  const Impl& from = source.checked();
  try {
    cl::Event event;
    impl.context->queue.enqueueCopyBuffer(from.buffer, impl.buffer, source_offset, offset, bytes,
                                          nullptr, impl.context->next_event(event));
    impl.context->timed("", "(copy)", event);
  } catch (const cl::Error& error) {
    throw_cl_error(
        error, fmt::format("Copying {} bytes from '{}' to '{}'", bytes, from.label, impl.label));
  }
}

}  // namespace raysplats
