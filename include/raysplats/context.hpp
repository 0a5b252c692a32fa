// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "raysplats/device.hpp"

namespace raysplats {

class BuildOptions;
class FaultInjection;
class Kernel;
class Profiler;

/// How a context works on its device.
struct ContextOptions {
  bool profile = false;          ///< time every launch by device events
  bool keep_launches = false;    ///< with profile: also keep each time for take_launches()
  bool kernel_cache = true;      ///< keep compiled programs in `cache_directory`
  bool tuning = true;            ///< use what `raysplats tune` stored for the device
  std::string kernel_directory;  ///< kernels are read from here; "" = those that are built in, or
                                 ///< of the folder that RAYSPLATS_KERNEL_DIR names
  std::string cache_directory;   ///< "" = ${XDG_CACHE_HOME:-~/.cache}/raysplats
  /// A program that is started as `PROGRAM compile-kernels ...` to compile kernels for a CPU, whose
  /// drivers compile one of a process at a time, where several wait; "" = none. `raysplats` is
  /// one.
  std::filesystem::path compiler;
  /// Programs that are compiled at the same time; 0 = one per core of the host, at most 8.
  std::size_t compilers = 0;
  /// Hears of every program that the compiler, not the cache, makes: before (its number from 1, its
  /// file below cl/), and when it is done (its number, "").
  std::function<void(std::size_t number, const std::string& program)> compiling;
};

/// Device time of one launch. Fills and copies of buffers have no program and are named "(fill)"
/// and "(copy)".
struct LaunchTime {
  std::string program;  ///< file below cl/
  std::string kernel;   ///< function in it
  double seconds = 0;   ///< by the device's own clock
};

/// One device with an in-order queue and its compiled programs. Models and tracers are made with a
/// context, belong to it alone, and have to go before it does.
///
/// Threads: Model, Tracer, PathTracer and Trainer lock their context while they work, as do
/// profile_table() and take_launches(), so threads that share one take turns; what several calls do
/// together (forward and backward) is held together by lock(). For work at the same time take a
/// context per thread. Everything else here, and the making of contexts from the same device, is
/// for one thread at a time.
class Context {
 public:
  /// Opens a device of list_devices() or select_device(). Throws DeviceError when the driver does
  /// not give it.
  explicit Context(const DeviceInfo& device, const ContextOptions& options = {});
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  /// The device, with the tuning in use.
  const DeviceInfo& device() const;
  /// Replaces the tuning in use; tracers made later follow it.
  void set_tuning(const std::optional<DeviceTuning>& tuning);

  /// Blocks until everything enqueued has finished; errors of earlier launches surface here.
  void finish();

  /// How often the host has waited until the device had nothing left to do: finish(), and reads and
  /// writes of buffers that block.
  std::uint64_t host_waits() const;

  /// Seconds that programs have been waited for so far, from the cache or the compiler: they are no
  /// part of any work, and are waited for once.
  double build_seconds() const;

  /// Keeps other threads from using the context until the lock goes. A thread may lock it again.
  [[nodiscard]] std::unique_lock<std::recursive_mutex> lock() const;

  /// Calls and device time in milliseconds of every kernel so far, as a table; blocks. Without
  /// ContextOptions::profile it has no rows.
  std::string profile_table();
  /// The launches since the last call, in the order in which they ran; blocks. None without
  /// ContextOptions::keep_launches.
  std::vector<LaunchTime> take_launches();

  /// Bytes in live buffers of this context.
  std::size_t allocated_bytes() const;
  /// The most bytes that there have been in live buffers at a time.
  std::size_t peak_allocated_bytes() const;

  // What follows serves the library itself; its types are not installed.

  /// The kernel `name` of the file `program` below cl/, built with `options` (memory, then disk
  /// cache, then compiler). The program is made in other threads: the kernel waits for it when it
  /// is first used, and throws DeviceError with the compiler's log then when the build fails.
  Kernel kernel(const std::string& program, const std::string& name, const BuildOptions& options);
  Kernel kernel(const std::string& program, const std::string& name);
  /// Waits until all programs that kernels were asked of are made, or have failed.
  void finish_builds();
  Profiler& profiler();
  FaultInjection& faults();
  /// A number that this context has not given before.
  std::uint64_t new_revision();
  struct Impl;
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
