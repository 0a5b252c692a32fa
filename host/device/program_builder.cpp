// SPDX-License-Identifier: Apache-2.0
#include "device/program_builder.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdlib>
#include <new>
#include <string_view>
#include <system_error>
#include <utility>

#include "device/argument_type.hpp"
#include "device/driver_trouble.hpp"
#include "device/kernel_sources.hpp"
#include "raysplats/error.hpp"
#include "util/memory_limit.hpp"

namespace raysplats {
namespace {

// Fused multiply-add is wanted everywhere; reordering and ignoring NaN are not.
constexpr const char* kCompilerOptions = "-cl-mad-enable";

// Compilers print warnings, or how many there were, to the terminal behind our back: they are for
// those who ask for them.
std::string compiler_flags(const BuildOptions& build) {
  std::string flags = kCompilerOptions;
  if (arguments_are_checked()) flags += " -cl-kernel-arg-info";
  if (!spdlog::should_log(spdlog::level::debug)) flags += " -w";
  return flags + " " + build.text();
}

// Compilers take 100 MB and more each.
constexpr std::size_t kMostCompilers = 8;

// Nothing when the driver has none.
std::string build_log(const cl::Program& program, const cl::Device& device) {
  try {
    return program.getBuildInfo<CL_PROGRAM_BUILD_LOG>(device);
  } catch (const cl::Error&) {
    return "";
  }
}

// PoCL keeps compiled kernels by their source, each for the work-groups that it was launched in. To
// give a binary it compiles all of them once more, for any work-group, which takes as long as the
// first time; programs that are built again are as fast without. The cache keeps an empty entry.
bool driver_keeps_programs(const DeviceInfo& device) {
  if (!is_pocl(device.platform)) return false;
  const char* kept = std::getenv("POCL_KERNEL_CACHE");
  return kept == nullptr || std::string_view(kept) != "0";
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

// Programs that are compiled at the same time. Where memory is bounded, compilers that run out of
// it together would end the process.
std::size_t compilers_of(const ContextOptions& options) {
  if (!memory_limit_remark().empty()) return 1;
  if (options.compilers > 0) return options.compilers;
  return std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, kMostCompilers);
}

// PoCL compiles one program of a process at a time and would let launches wait meanwhile; Oclgrind
// knows no threads.
bool one_at_a_time(const std::string& platform) {
  return is_pocl(platform) || platform.find("Oclgrind") != std::string::npos;
}

// What PoCL has compiled it reads and links again in the process that runs it, one program at a
// time: two processes take as long as one. On a card every process would take memory from the one
// that runs there.
bool gains_by_processes(const DeviceInfo& device, std::size_t compilers) {
  return device.type == DeviceType::kCpu && compilers > (is_pocl(device.platform) ? 2u : 1u);
}

}  // namespace

struct ProgramBuilder::Build {
  enum class State { kWaits, kRuns, kDone };

  std::string path;
  std::string source;
  std::string flags;
  std::string key;  // of the cache
  bool fails = false;

  // Read and written with the builder's mutex.
  State state = State::kWaits;
  bool compiles = false;  // the cache did not have it
  cl::Program program;
  std::exception_ptr error;

  // Set by the threads that ask, which alone read them.
  bool announced = false;
  bool concluded = false;
};

ProgramBuilder::ProgramBuilder(const cl::Context& context,
                               const cl::Device& device,
                               const DeviceInfo& info,
                               const ContextOptions& options)
    : context_(context),
      device_(device),
      info_(info),
      options_(options),
      cache_(options.cache_directory),
      driver_keeps_(driver_keeps_programs(info)),
      apart_(!options.compiler.empty() && options.kernel_directory.empty() &&
             options.kernel_cache && !cache_.directory().empty() &&
             gains_by_processes(info, compilers_of(options))),
      most_threads_(compilers_of(options)) {
  if (apart_) return;
  // The thread that waits compiles as well.
  most_threads_ = one_at_a_time(info.platform) ? 0 : most_threads_ - 1;
}

ProgramBuilder::~ProgramBuilder() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
    queue_.clear();
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

std::shared_ptr<ProgramBuilder::Build> ProgramBuilder::begin(const std::string& path,
                                                             const BuildOptions& options,
                                                             bool fails) {
  auto build = std::make_shared<Build>();
  build->path = path;
  build->source = resolve_kernel_source(path, options_.kernel_directory);
  build->flags = compiler_flags(options);
  build->key = ProgramCache::key(build->source, build->flags, info_);
  build->fails = fails;
  {
    const std::lock_guard lock(mutex_);
    queue_.push_back(build);
    if (threads_.size() < std::min(most_threads_, queue_.size() + running_)) {
      try {
        threads_.emplace_back([this] { work(); });
      } catch (const std::system_error& error) {
        spdlog::debug("no thread to compile in: {}", error.what());
        most_threads_ = threads_.size();
      }
    }
  }
  changed_.notify_all();
  return build;
}

cl::Program ProgramBuilder::finish(const std::shared_ptr<Build>& build) {
  std::unique_lock lock(mutex_);
  while (build->state != Build::State::kDone) {
    if (build->compiles && !build->announced) {
      lock.unlock();
      announce(*build);
      lock.lock();
      continue;
    }
    const auto own = std::find(queue_.begin(), queue_.end(), build);
    if (own != queue_.end()) std::rotate(queue_.begin(), own, own + 1);
    if (queue_.empty() || (apart_ && !threads_.empty())) {
      changed_.wait(lock);
      continue;
    }
    const std::shared_ptr<Build> taken = queue_.front();
    queue_.pop_front();
    std::optional<CompilerProcess> none;
    run(*taken, lock, taken == build, none);
  }
  lock.unlock();
  if (build->compiles) {
    announce(*build);
    if (!std::exchange(build->concluded, true) && options_.compiling) options_.compiling(told_, "");
  }
  if (build->error) std::rethrow_exception(build->error);
  return build->program;
}

bool ProgramBuilder::failed(const Build& build) {
  const std::lock_guard lock(mutex_);
  return build.error != nullptr;
}

void ProgramBuilder::announce(Build& build) {
  if (std::exchange(build.announced, true)) return;
  ++told_;
  if (options_.compiling) options_.compiling(told_, build.path);
}

void ProgramBuilder::work() {
  std::optional<CompilerProcess> process;
  std::unique_lock lock(mutex_);
  while (true) {
    if (queue_.empty() && process) {
      lock.unlock();
      process.reset();
      lock.lock();
    }
    changed_.wait(lock, [&] { return ends_ || !queue_.empty(); });
    if (ends_) return;
    const std::shared_ptr<Build> build = queue_.front();
    queue_.pop_front();
    run(*build, lock, false, process);
  }
}

void ProgramBuilder::run(Build& build,
                         std::unique_lock<std::mutex>& lock,
                         bool awaited,
                         std::optional<CompilerProcess>& process) {
  build.state = Build::State::kRuns;
  ++running_;
  lock.unlock();
  cl::Program program;
  std::exception_ptr error;
  try {
    const auto compiling = [&] {
      bool others = false;
      {
        const std::lock_guard compiles(mutex_);
        build.compiles = true;
        others = running_ > 1 || !queue_.empty();
      }
      changed_.notify_all();
      if (awaited) announce(build);
      return others;
    };
    program = make(build, compiling, process);
  } catch (...) {
    error = std::current_exception();
  }
  lock.lock();
  build.program = program;
  build.error = error;
  build.state = Build::State::kDone;
  --running_;
  changed_.notify_all();
}

cl::Program ProgramBuilder::make(const Build& build,
                                 const std::function<bool()>& compiling,
                                 std::optional<CompilerProcess>& process) {
  if (!options_.kernel_cache || build.fails) {
    compiling();
    return compile(build);
  }
  if (const std::optional<cl::Program> cached = from_cache(build)) return *cached;
  // One process at a time: the others find the result, and some drivers fail when several compile
  // the same source.
  const ProgramCache::BuildLock lock(cache_.directory(), build.key);
  if (const std::optional<cl::Program> cached = from_cache(build)) return *cached;
  if (compiling() && apart_) {
    if (const std::optional<cl::Program> made = compile_apart(build, process)) return *made;
  }
  cl::Program program = compile(build);
  store(build, program);
  return program;
}

// Nothing when the process fails: why, this one finds out.
std::optional<cl::Program> ProgramBuilder::compile_apart(const Build& build,
                                                         std::optional<CompilerProcess>& process) {
  try {
    if (!process) process.emplace(options_.compiler, info_, cache_.directory());
    process->compile(build.path, build.flags);
  } catch (const Error& error) {
    spdlog::debug("compiling in another process: {}", error.what());
    process.reset();
    return std::nullopt;
  }
  return from_cache(build);
}

void ProgramBuilder::store(const Build& build, const cl::Program& program) const {
  if (driver_keeps_) {
    cache_.store(build.key, {});
    return;
  }
  const cl::Program::Binaries binaries = program.getInfo<CL_PROGRAM_BINARIES>();
  if (binaries.size() == 1 && !binaries[0].empty()) cache_.store(build.key, binaries[0]);
}

void ProgramBuilder::compile_for_cache(const std::string& path, const std::string& flags) {
  Build build;
  build.path = path;
  build.source = resolve_kernel_source(path);
  build.flags = flags;
  build.key = ProgramCache::key(build.source, flags, info_);
  store(build, compile(build));
}

cl::Program ProgramBuilder::compile(const Build& build) const {
  auto program = std::make_unique<cl::Program>(context_, build.source);
  try {
    if (build.fails) throw cl::Error(CL_BUILD_PROGRAM_FAILURE, "clBuildProgram");
    program->build({device_}, build.flags.c_str());
  } catch (const std::bad_alloc&) {
    // It came through the driver, which holds its lock of the program for good: releasing the
    // program would wait for ever.
    static_cast<void>(program.release());
    throw ResourceError(
        fmt::format("The OpenCL driver has no memory left to compile {}{}: close other programs or "
                    "allow this one more",
                    build.path, memory_limit_remark()));
  } catch (const cl::Error& error) {
    const std::string log = build_log(*program, device_);
    const std::string folder = kernel_folder(options_.kernel_directory);
    std::string remedy = driver_trouble(info_.platform);
    // Built-in kernels are right; those of a folder are its owner's.
    if (remedy.empty())
      remedy = folder.empty() ? "update the driver or choose another --device" : "correct it";
    throw DeviceError(
        fmt::format("Kernel file {}{}{} does not compile on {} with '{}' ({}): {}{}{}", folder,
                    folder.empty() ? "" : "/", build.path, info_.name, build.flags,
                    cl_error_name(error.err()), remedy, log.empty() ? "" : "\n", log));
  }
  if (spdlog::should_log(spdlog::level::debug)) {
    const std::string log = build_log(*program, device_);
    if (!log.empty()) spdlog::debug("kernel file {} with '{}': {}", build.path, build.flags, log);
  }
  return *program;
}

std::optional<cl::Program> ProgramBuilder::from_cache(const Build& build) const {
  const auto binary = cache_.load(build.key);
  if (!binary) return std::nullopt;
  if (binary->empty()) return driver_keeps_ ? std::optional(compile(build)) : std::nullopt;
  try {
    cl::Program program(context_, {device_}, cl::Program::Binaries{*binary});
    program.build({device_}, build.flags.c_str());
    if (arguments_are_checked() && !tells_arguments(program)) return std::nullopt;
    return program;
  } catch (const cl::Error&) {
    // A binary is refused for example after a driver update with the same version string.
    cache_.remove(build.key);
    return std::nullopt;
  }
}

// Shared by those who compile at the same time in this context.
}  // namespace raysplats
