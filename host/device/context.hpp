// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "device/build_options.hpp"
#include "device/kernel.hpp"
#include "raysplats/device.hpp"

namespace raysplats {

class Profiler;

struct ContextOptions {
  bool profile = false;         ///< time every launch by device events
  bool keep_launches = false;   ///< with profile: also keep each time for take_launches()
  bool kernel_cache = true;     ///< keep compiled programs in the user's cache directory
  bool tuning = true;           ///< use what `raysplats tune` stored for the device
  std::string cache_directory;  ///< "" = ${XDG_CACHE_HOME:-~/.cache}/raysplats
};

/// Device time of one launch. Fills and copies of buffers have no program and are named "(fill)"
/// and
/// "(copy)".
struct LaunchTime {
  std::string program;  ///< file below cl/
  std::string kernel;
  double seconds = 0;
};

/// One device with an in-order queue and its compiled programs. Everything enqueued runs in order;
/// reads block. Not thread-safe: one thread at a time talks to a context.
class Context {
 public:
  explicit Context(const DeviceInfo& device, const ContextOptions& options = {});
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  const DeviceInfo& device() const;
  /// Replaces the tuning in use; tracers made later follow it.
  void set_tuning(const std::optional<DeviceTuning>& tuning);

  /// The kernel `name` of the file `program` below cl/, built with `options` (memory, then disk
  /// cache, then compiler). Throws DeviceError with the compiler's log when the build fails.
  Kernel kernel(const std::string& program,
                const std::string& name,
                const BuildOptions& options = {});

  /// Blocks until everything enqueued has finished; errors of earlier launches surface here.
  void finish();

  Profiler& profiler();

  /// With keep_launches: what has run since the last call, in order; blocks. Else nothing.
  std::vector<LaunchTime> take_launches();

  /// Bytes in live buffers of this context, and the most there have been.
  std::size_t allocated_bytes() const;
  std::size_t peak_allocated_bytes() const;

  struct Impl;
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
