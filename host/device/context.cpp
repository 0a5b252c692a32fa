// SPDX-License-Identifier: Apache-2.0
#include "device/context.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <new>
#include <string_view>
#include <utility>

#include "device/context_impl.hpp"
#include "device/driver_trouble.hpp"
#include "device/platform.hpp"
#include "device/program_cache.hpp"
#include "device/tuning.hpp"
#include "raysplats/error.hpp"
#include "util/memory_limit.hpp"

namespace raysplats {
namespace {

// Fused multiply-add is wanted everywhere; reordering and ignoring NaN are not.
constexpr const char* kCompilerOptions = "-cl-mad-enable";

// Compilers print warnings, or how many there were, to the terminal behind our back: they are for
// those who ask for them.
std::string compiler_flags(const BuildOptions& build, bool check_arguments) {
  std::string flags = kCompilerOptions;
  if (check_arguments) flags += " -cl-kernel-arg-info";
  if (!spdlog::should_log(spdlog::level::debug)) flags += " -w";
  return flags + " " + build.text();
}

// Nothing when the driver has none.
std::string build_log(const cl::Program& program, const cl::Device& device) {
  try {
    return program.getBuildInfo<CL_PROGRAM_BUILD_LOG>(device);
  } catch (const cl::Error&) {
    return "";
  }
}

cl::Program compile(Context::Impl& context,
                    const std::string& path,
                    const std::string& source,
                    const std::string& options,
                    bool told = true) {
  auto program = std::make_unique<cl::Program>(context.context, source);
  const auto tell = [&](const std::string& what) {
    if (told && context.options.compiling) context.options.compiling(context.compiled, what);
  };
  if (told) ++context.compiled;
  tell(path);
  try {
    context.faults.check(Fault::kBuild);
    program->build({context.device}, options.c_str());
  } catch (const std::bad_alloc&) {
    // It came through the driver, which holds its lock of the program for good: releasing the
    // program would wait for ever.
    static_cast<void>(program.release());
    throw ResourceError(
        fmt::format("The OpenCL driver has no memory left to compile {}{}: close other programs or "
                    "allow this one more",
                    path, memory_limit_remark()));
  } catch (const cl::Error& error) {
    const std::string log = build_log(*program, context.device);
    const std::string trouble = driver_trouble();
    throw DeviceError(
        fmt::format("Kernel file {} does not compile on {} with '{}' ({}): {}{}{}", path,
                    context.info.name, options, cl_error_name(error.err()),
                    trouble.empty() ? "update the driver or choose another --device" : trouble,
                    log.empty() ? "" : "\n", log));
  }
  tell("");
  if (spdlog::should_log(spdlog::level::debug)) {
    const std::string log = build_log(*program, context.device);
    if (!log.empty()) spdlog::debug("kernel file {} with '{}': {}", path, options, log);
  }
  return *program;
}

// Empty when the binary is not accepted, for example after a driver update with the same version
// string.
std::optional<cl::Program> from_binary(Context::Impl& context,
                                       const std::vector<unsigned char>& binary,
                                       const std::string& options) {
  try {
    cl::Program program(context.context, {context.device}, cl::Program::Binaries{binary});
    program.build({context.device}, options.c_str());
    return program;
  } catch (const cl::Error&) {
    return std::nullopt;
  }
}

// PoCL keeps compiled kernels by their source, each for the work-groups that it was launched in. To
// give a binary it compiles all of them once more, for any work-group, which takes as long as the
// first time; programs that are built again are as fast without. The cache keeps an empty entry.
bool driver_keeps_programs(const DeviceInfo& device) {
  if (device.platform.find("Portable Computing Language") == std::string::npos) return false;
  const char* kept = std::getenv("POCL_KERNEL_CACHE");
  return kept == nullptr || std::string_view(kept) != "0";
}

void store_binary(const ProgramCache& cache, const std::string& key, const cl::Program& program) {
  const cl::Program::Binaries binaries = program.getInfo<CL_PROGRAM_BINARIES>();
  if (binaries.size() == 1 && !binaries[0].empty()) cache.store(key, binaries[0]);
}

// Programs made from binaries need not (OpenCL 1.2, section 5.7.3).
bool tells_arguments(const cl::Program& program) {
  std::vector<cl::Kernel> kernels;
  try {
    cl::Program(program).createKernels(&kernels);
    for (const cl::Kernel& kernel : kernels) {
      if (kernel.getInfo<CL_KERNEL_NUM_ARGS>() > 0)
        static_cast<void>(kernel.getArgInfo<CL_KERNEL_ARG_TYPE_NAME>(0));
    }
    return true;
  } catch (const cl::Error&) {
    return false;
  }
}

}  // namespace

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
  cl::Program& built = impl_->program(program, options);
  auto kernel = std::make_shared<Kernel::Impl>();
  kernel->context = impl_.get();
  kernel->program = program;
  kernel->name = name;
  try {
    kernel->kernel = cl::Kernel(built, name.c_str());
    kernel->argument_count = kernel->kernel.getInfo<CL_KERNEL_NUM_ARGS>();
  } catch (const cl::Error& error) {
    throw_cl_error(error, fmt::format("Kernel {} of {}", name, program));
  }
  return Kernel(kernel);
}

Kernel Context::kernel(const std::string& program, const std::string& name) {
  return kernel(program, name, BuildOptions());
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
  impl_->collect_profile();
  return impl_->profiler;
}

std::string Context::profile_table() { return profiler().table(); }

std::vector<LaunchTime> Context::take_launches() {
  impl_->collect_profile();
  return std::exchange(impl_->launches, {});
}

double Context::build_seconds() const { return impl_->build_seconds; }

std::size_t Context::allocated_bytes() const { return impl_->memory->allocated; }
std::size_t Context::peak_allocated_bytes() const { return impl_->memory->peak; }

cl::Program& Context::Impl::program(const std::string& path, const BuildOptions& build) {
  const std::string key = path + " " + build.text();
  if (const auto found = programs.find(key); found != programs.end()) return found->second;
  const auto begin = std::chrono::steady_clock::now();
  cl::Program made = make_program(path, build);
  build_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return programs[key] = made;
}

cl::Program Context::Impl::make_program(const std::string& path, const BuildOptions& build) {
  const std::string source = resolve_kernel_source(path, options.kernel_directory);
  const std::string flags = compiler_flags(build, check_arguments);
  if (!options.kernel_cache || faults.due(Fault::kBuild))
    return compile(*this, path, source, flags);

  const ProgramCache cache(options.cache_directory);
  const std::string cache_key = ProgramCache::key(source, flags, info);
  const bool kept = driver_keeps_programs(info);
  if (kept) {
    const auto entry = cache.load(cache_key);
    if (entry && entry->empty()) return compile(*this, path, source, flags, false);
  }
  const auto cached = [&]() -> std::optional<cl::Program> {
    const auto binary = cache.load(cache_key);
    if (!binary || binary->empty()) return std::nullopt;
    auto program = from_binary(*this, *binary, flags);
    if (!program) cache.remove(cache_key);
    if (program && check_arguments && !tells_arguments(*program)) return std::nullopt;
    return program;
  };
  std::optional<cl::Program> program = cached();
  if (!program) {
    // One process at a time: the others find the result, and some drivers fail when several compile
    // the same source.
    const ProgramCache::BuildLock lock = cache.lock_builds();
    program = cached();
    if (!program) {
      program = compile(*this, path, source, flags);
      if (kept) {
        cache.store(cache_key, {});
      } else {
        store_binary(cache, cache_key, *program);
      }
      return *program;
    }
  }
  faults.check(Fault::kBuild);
  return *program;
}

void Context::Impl::timed(const std::string& path,
                          const std::string& kernel,
                          const cl::Event& event) {
  if (timed_events != nullptr) timed_events->push_back(event);
  if (!options.profile) return;
  pending.push_back({path, kernel, event});
  if (pending.size() >= 4096) collect_profile();
}

void Context::Impl::keep_until(const cl::Event& event, std::shared_ptr<const void> memory) {
  in_flight.push_back({event, std::move(memory)});
  // In order: what is over stands in front. A command that failed says so where it is waited for.
  const auto waits = [](const InFlight& operation) {
    return operation.event.getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>() > CL_COMPLETE;
  };
  in_flight.erase(in_flight.begin(), std::find_if(in_flight.begin(), in_flight.end(), waits));
}

bool is_over(const cl::Event& event) {
  const cl_int status = event.getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>();
  if (status < 0) throw cl::Error(status, "clGetEventInfo");
  return status == CL_COMPLETE;
}

void Context::Impl::collect_profile() {
  if (pending.empty()) return;
  queue.finish();
  for (const PendingLaunch& launch : pending) {
    const std::uint64_t nanoseconds = launch.event.getProfilingInfo<CL_PROFILING_COMMAND_END>() -
                                      launch.event.getProfilingInfo<CL_PROFILING_COMMAND_START>();
    profiler.add(launch.kernel, nanoseconds);
    if (options.keep_launches) {
      launches.push_back({launch.program, launch.kernel, 1e-9 * static_cast<double>(nanoseconds)});
    }
  }
  pending.clear();
}

}  // namespace raysplats
