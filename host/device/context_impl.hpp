// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
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
#include "device/program_builder.hpp"

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
  bool check_arguments = false;             // RAYSPLATS_CHECK_ARGUMENTS
  std::unique_ptr<ProgramBuilder> builder;  // none before the first program
  std::map<std::string, std::shared_ptr<ProgramBuilder::Build>> programs;  // by path and options
  std::vector<PendingLaunch> pending;
  std::vector<LaunchTime> launches;
  std::deque<InFlight> in_flight;
  std::vector<cl::Event>* timed_events = nullptr;  // of a LaunchTimer that runs
  bool sampled = false;                            // by a KernelSample
  std::uint64_t host_waits = 0;
  double build_seconds = 0;
  std::shared_ptr<MemoryCount> memory = std::make_shared<MemoryCount>();

  std::recursive_mutex mutex;
  std::uint64_t revisions = 0;

  std::shared_ptr<ProgramBuilder::Build> begin_program(const std::string& path,
                                                       const BuildOptions& build);
  /// Waits for it; the wait counts as build_seconds.
  cl::Program program(const std::shared_ptr<ProgramBuilder::Build>& build);
  /// Keeps host memory until the command that uses it is over.
  void keep_until(const cl::Event& event, std::shared_ptr<const void> memory);
  /// What an enqueue call takes for its event: null unless launches are timed.
  cl::Event* next_event(cl::Event& event) {
    return profiled() || timed_events != nullptr ? &event : nullptr;
  }
  bool profiled() const { return options.profile || sampled; }
  void timed(const std::string& program, const std::string& kernel, const cl::Event& event);
  void collect_profile();
};

struct Kernel::Impl {
  Context::Impl* context = nullptr;
  std::shared_ptr<ProgramBuilder::Build> build;
  cl::Kernel kernel;  // none before it is used
  std::string program;
  std::string name;
  unsigned argument_count = 0;
  std::vector<ArgumentType> checked;  // what was found right for every argument

  /// Waits for its program the first time.
  void make();
};

struct RawBuffer::Impl {
  Context::Impl* context;
  std::shared_ptr<MemoryCount> memory;
  cl::Buffer buffer;
  std::size_t bytes;
  std::string label;
  ~Impl();
};

}  // namespace raysplats
