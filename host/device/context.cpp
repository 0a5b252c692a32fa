// SPDX-License-Identifier: Apache-2.0
#include "device/context.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <memory>
#include <utility>

#include "device/context_impl.hpp"
#include "device/platform.hpp"
#include "device/tuning.hpp"
#include "raysplats/error.hpp"

namespace raysplats {
Context::Context(const DeviceInfo& device, const ContextOptions& options)
    : impl_(std::make_unique<Impl>()) {
  impl_->options = options;
  const std::vector<PlatformDevice> devices = platform_devices();
  if (device.index >= devices.size() || devices[device.index].info.name != device.name) {
    throw DeviceError(fmt::format("OpenCL device {} ({}) is gone", device.index, device.name));
  }
  impl_->info = device;
  impl_->info.tuning.reset();
  if (options.tuning) impl_->info.tuning = TuningStore(options.cache_directory).find(device);
  impl_->device = devices[device.index].device;
  impl_->canaries = Canaries::from_environment();
  impl_->check_arguments = arguments_are_checked();
  try {
    impl_->context = cl::Context(impl_->device);
    // GPUs always need it, because LaunchTimer bounds their launches by it.
    impl_->queue = cl::CommandQueue(impl_->context, impl_->device, cl::QueueProperties::Profiling);
  } catch (const cl::Error& error) {
    throw_cl_error(error, fmt::format("Opening the OpenCL device {}", device.name));
  }
}

Context::~Context() {
  try {
    impl_->queue.finish();
  } catch (const cl::Error& error) {
    spdlog::debug("closing the queue: {}", cl_error_name(error.err()));
  }
}

const DeviceInfo& Context::device() const { return impl_->info; }

void Context::set_tuning(const std::optional<DeviceTuning>& tuning) { impl_->info.tuning = tuning; }

Kernel Context::kernel(const std::string& program,
                       const std::string& name,
                       const BuildOptions& options) {
  auto kernel = std::make_shared<Kernel::Impl>();
  kernel->context = impl_.get();
  kernel->build = impl_->begin_program(program, options);
  kernel->program = program;
  kernel->name = name;
  return Kernel(kernel);
}

Kernel Context::kernel(const std::string& program, const std::string& name) {
  return kernel(program, name, BuildOptions());
}

void Context::finish_builds() {
  for (const auto& [key, build] : impl_->programs) {
    try {
      impl_->program(build);
    } catch (const Error& error) {
      spdlog::debug("{}", error.what());  // said again where it is used
    }
  }
}

std::uint64_t Context::new_revision() { return ++impl_->revisions; }

std::unique_lock<std::recursive_mutex> Context::lock() const {
  return std::unique_lock(impl_->mutex);
}

void Context::finish() {
  ++impl_->host_waits;
  try {
    impl_->queue.finish();
  } catch (const cl::Error& error) {
    throw_cl_error(error, fmt::format("Waiting for {}", impl_->info.name));
  }
}

std::uint64_t Context::host_waits() const { return impl_->host_waits; }

FaultInjection& Context::faults() { return impl_->faults; }

Profiler& Context::profiler() {
  const auto turn = lock();
  impl_->collect_profile();
  return impl_->profiler;
}

std::string Context::profile_table() {
  const auto turn = lock();
  return profiler().table();
}

std::vector<LaunchTime> Context::take_launches() {
  const auto turn = lock();
  impl_->collect_profile();
  return std::exchange(impl_->launches, {});
}

double Context::build_seconds() const { return impl_->build_seconds; }

std::size_t Context::allocated_bytes() const { return impl_->memory->allocated; }
std::size_t Context::peak_allocated_bytes() const { return impl_->memory->peak; }

std::shared_ptr<ProgramBuilder::Build> Context::Impl::begin_program(const std::string& path,
                                                                    const BuildOptions& build) {
  if (!builder) builder = std::make_unique<ProgramBuilder>(context, device, info, options);
  const std::string key = path + " " + build.text();
  const auto begun = programs.find(key);
  if (begun != programs.end() && !builder->failed(*begun->second)) return begun->second;
  return programs[key] = builder->begin(path, build, faults.strikes(Fault::kBuild));
}

cl::Program Context::Impl::program(const std::shared_ptr<ProgramBuilder::Build>& build) {
  const auto begin = std::chrono::steady_clock::now();
  const auto end = [&] {
    build_seconds +=
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  try {
    cl::Program made = builder->finish(build);
    end();
    return made;
  } catch (...) {
    end();
    throw;
  }
}

void Context::Impl::timed(const std::string& path,
                          const std::string& kernel,
                          const cl::Event& event) {
  if (timed_events != nullptr) timed_events->push_back(event);
  if (!profiled()) return;
  pending.push_back({path, kernel, event});
  if (pending.size() >= 4096) collect_profile();
}

void Context::Impl::keep_until(const cl::Event& event, std::shared_ptr<const void> memory) {
  in_flight.push_back({event, std::move(memory)});
  // In order: what is over stands in front. A command that failed says so where it is waited for.
  const auto waits = [](const InFlight& operation) {
    return operation.event.getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>() > CL_COMPLETE;
  };
  while (!in_flight.empty() && !waits(in_flight.front())) in_flight.pop_front();
}

bool is_over(const cl::Event& event) {
  const cl_int status = event.getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>();
  if (status < 0) throw cl::Error(status, "clGetEventInfo");
  return status == CL_COMPLETE;
}

void Context::Impl::collect_profile() {
  if (pending.empty()) return;
  // A launch that failed has no times, and would have none the next time either.
  const auto over = std::exchange(pending, {});
  try {
    queue.finish();
    for (const PendingLaunch& launch : over) {
      const std::uint64_t nanoseconds = launch.event.getProfilingInfo<CL_PROFILING_COMMAND_END>() -
                                        launch.event.getProfilingInfo<CL_PROFILING_COMMAND_START>();
      profiler.add(launch.kernel, nanoseconds);
      if (options.keep_launches) {
        launches.push_back(
            {launch.program, launch.kernel, 1e-9 * static_cast<double>(nanoseconds)});
      }
    }
  } catch (const cl::Error& error) {
    throw_cl_error(error, fmt::format("Timing the kernels of {}", info.name));
  }
}

}  // namespace raysplats
