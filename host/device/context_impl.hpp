// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "device/canaries.hpp"
#include "device/cl.hpp"
#include "device/context.hpp"
#include "device/fault_injection.hpp"
#include "device/profiler.hpp"

namespace raysplats {

/// Bytes in buffers; shared with them, so that one may go after its context, in any thread.
struct MemoryCount {
  std::atomic<std::size_t> allocated = 0;
  std::atomic<std::size_t> peak = 0;
  void add(std::size_t bytes) {
    const std::size_t now = allocated += bytes;
    std::size_t most = peak;
    while (most < now && !peak.compare_exchange_weak(most, now)) {
    }
  }
};

/// A launch whose time is not read yet.
struct PendingLaunch {
  std::string program;
  std::string kernel;
  cl::Event event;
};

/// What an operation that is on its way reads or writes.
struct InFlight {
  cl::Event event;
  std::shared_ptr<const void> memory;
};

/// Whether the command has been carried out; throws cl::Error when it failed.
bool is_over(const cl::Event& event);

struct Context::Impl {
  DeviceInfo info;
  ContextOptions options;
  cl::Device device;
  cl::Context context;
  cl::CommandQueue queue;
  Profiler profiler;
  std::unique_ptr<Canaries> canaries;  // usually none
  FaultInjection faults;
  bool check_arguments = false;                 // RAYSPLATS_CHECK_ARGUMENTS
  std::map<std::string, cl::Program> programs;  // by program path and build options
  std::vector<PendingLaunch> pending;
  std::vector<LaunchTime> launches;
  std::vector<InFlight> in_flight;
  std::vector<cl::Event>* timed_events = nullptr;  // of a LaunchTimer that runs
  std::uint64_t host_waits = 0;
  std::size_t compiled = 0;  // programs that the compiler made
  double build_seconds = 0;
  std::shared_ptr<MemoryCount> memory = std::make_shared<MemoryCount>();

  std::recursive_mutex mutex;
  std::uint64_t revisions = 0;

  cl::Program& program(const std::string& path, const BuildOptions& build);
  cl::Program make_program(const std::string& path, const BuildOptions& build);
  /// Keeps host memory until the command that uses it is over.
  void keep_until(const cl::Event& event, std::shared_ptr<const void> memory);
  /// What an enqueue call takes for its event: null unless launches are timed.
  cl::Event* next_event(cl::Event& event) {
    return options.profile || timed_events != nullptr ? &event : nullptr;
  }
  void timed(const std::string& program, const std::string& kernel, const cl::Event& event);
  void collect_profile();
};

struct Kernel::Impl {
  Context::Impl* context = nullptr;
  cl::Kernel kernel;
  std::string program;
  std::string name;
  unsigned argument_count = 0;
  std::vector<ArgumentType> checked;  // what was found right for every argument
};

struct RawBuffer::Impl {
  Context::Impl* context;
  std::shared_ptr<MemoryCount> memory;
  cl::Buffer buffer;
  std::size_t bytes;
  std::string label;
  ~Impl();
};

/// The source of `path` with its `#include "..."` lines resolved from the embedded table (or from
/// `directory`, or RAYSPLATS_KERNEL_DIR when that is set), each file once, with #line marks.
std::string resolve_kernel_source(const std::string& path, const std::string& directory = "");

}  // namespace raysplats
