// SPDX-License-Identifier: Apache-2.0
#include "device/kernel.hpp"

#include <fmt/format.h>

#include <cstring>

#include "device/context_impl.hpp"
#include "raysplats/error.hpp"

namespace raysplats {

void Kernel::Impl::make() {
  if (kernel() != nullptr) return;
  const cl::Program made = context->program(build);
  try {
    kernel = cl::Kernel(made, name.c_str());
    argument_count = kernel.getInfo<CL_KERNEL_NUM_ARGS>();
  } catch (const cl::Error& error) {
    throw_cl_error(error, fmt::format("Kernel {} of {}", name, program));
  }
}

const std::string& Kernel::name() const { return impl_->name; }

std::size_t Kernel::max_work_group_size() const {
  impl_->make();
  return impl_->kernel.getWorkGroupInfo<CL_KERNEL_WORK_GROUP_SIZE>(impl_->context->device);
}

std::size_t Kernel::subgroups(std::size_t items) const {
  if (!impl_->context->info.has_subgroups) return 0;
  impl_->make();
  // Devices of OpenCL 2.0 know it as an extension alone, others need not have that.
  const cl::Device& device = impl_->context->device;
  // What getInfo() gives is a cl::Platform or a bare cl_platform_id, by the headers' age.
  const cl::Platform platform(device.getInfo<CL_DEVICE_PLATFORM>());
  void* found = clGetExtensionFunctionAddressForPlatform(platform(), "clGetKernelSubGroupInfoKHR");
  const auto ask = found != nullptr ? reinterpret_cast<decltype(&clGetKernelSubGroupInfo)>(found)
                                    : &clGetKernelSubGroupInfo;
  std::size_t number = 0;
  const cl_int status =
      ask(impl_->kernel.get(), device.get(), CL_KERNEL_SUB_GROUP_COUNT_FOR_NDRANGE, sizeof items,
          &items, sizeof number, &number, nullptr);
  return status == CL_SUCCESS ? number : 0;
}

std::size_t Kernel::argument_count() const {
  impl_->make();
  return impl_->argument_count;
}

void Kernel::begin(std::size_t argument_count) {
  impl_->make();
  if (argument_count != impl_->argument_count) {
    throw DeviceError(fmt::format("Kernel {} takes {} arguments, {} were given", impl_->name,
                                  impl_->argument_count, argument_count));
  }
}

void Kernel::check(unsigned index, const ArgumentType& type) {
  if (!impl_->context->check_arguments) return;
  std::vector<ArgumentType>& checked = impl_->checked;
  checked.resize(impl_->argument_count);
  ArgumentType& last = checked[index];
  if (last == type) return;
  try {
    const auto address = impl_->kernel.getArgInfo<CL_KERNEL_ARG_ADDRESS_QUALIFIER>(index);
    std::string name = impl_->kernel.getArgInfo<CL_KERNEL_ARG_TYPE_NAME>(index);
    name.resize(std::strlen(name.c_str()));
    const ArgumentPlace place = address == CL_KERNEL_ARG_ADDRESS_PRIVATE ? ArgumentPlace::kValue
                                : address == CL_KERNEL_ARG_ADDRESS_LOCAL ? ArgumentPlace::kLocal
                                                                         : ArgumentPlace::kBuffer;
    const std::string trouble = type.mismatch(name, place);
    if (!trouble.empty()) {
      throw DeviceError(fmt::format("Argument {} of kernel {} {}", index, impl_->name, trouble));
    }
  } catch (const cl::Error& error) {
    throw_cl_error(
        error, fmt::format("Asking for the type of argument {} of kernel {}", index, impl_->name));
  }
  last = type;
}

void Kernel::set_buffer(unsigned index, const RawBuffer& buffer, const ArgumentType& type) {
  check(index, type);
  if (buffer.empty())
    throw DeviceError(
        fmt::format("Argument {} of kernel {} is an empty buffer", index, impl_->name));
  try {
    impl_->kernel.setArg(index, buffer.impl()->buffer);
  } catch (const cl::Error& error) {
    throw_cl_error(error, fmt::format("Argument {} of kernel {}", index, impl_->name));
  }
}

void Kernel::set_local(unsigned index, std::size_t bytes) {
  check(index, {ArgumentPlace::kLocal, ArgumentNumbers::kWords, "", 0});
  set_bytes(index, nullptr, bytes);
}

void Kernel::set_value(unsigned index, const void* value, const ArgumentType& type) {
  check(index, type);
  set_bytes(index, value, type.bytes);
}

void Kernel::set_bytes(unsigned index, const void* value, std::size_t bytes) {
  try {
    impl_->kernel.setArg(index, bytes, value);
  } catch (const cl::Error& error) {
    throw_cl_error(error, fmt::format("Argument {} of kernel {}", index, impl_->name));
  }
}

void Kernel::enqueue(const Range& range) {
  const auto& g = range.global;
  const auto& l = range.local;
  const auto& o = range.offset;
  if (g[0] == 0 || g[1] == 0 || g[2] == 0) return;
  const cl::NDRange global(g[0], g[1], g[2]);
  const cl::NDRange offset(o[0], o[1], o[2]);
  const cl::NDRange local = l[0] == 0 ? cl::NullRange : cl::NDRange(l[0], l[1], l[2]);
  Context::Impl& context = *impl_->context;
  try {
    cl::Event event;
    context.faults.check(Fault::kLaunch);
    context.queue.enqueueNDRangeKernel(impl_->kernel, offset, global, local, nullptr,
                                       context.next_event(event));
    context.timed(impl_->program, impl_->name, event);
    if (context.canaries) {
      context.canaries->check(context.queue,
                              fmt::format("Kernel {} of {}", impl_->name, impl_->program));
    }
  } catch (const cl::Error& error) {
    throw_cl_error(
        error,
        fmt::format("Launching kernel {} with global size {}x{}x{} and local size {}x{}x{} on {}",
                    impl_->name, g[0], g[1], g[2], l[0], l[1], l[2], context.info.name));
  }
}

}  // namespace raysplats
