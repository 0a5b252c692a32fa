// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "device/build_options.hpp"
#include "device/cl.hpp"
#include "device/compiler_process.hpp"
#include "device/program_cache.hpp"
#include "raysplats/context.hpp"

namespace raysplats {

/// Makes the programs of a context: from the cache, or by the driver's compiler in threads of their
/// own, and in processes where ContextOptions::compiler names one. A program is begun when it is
/// asked for and waited for when it is first used, so that those that are asked for together are
/// made at the same time. Asking is for one thread at a time.
class ProgramBuilder {
 public:
  ProgramBuilder(const cl::Context& context,
                 const cl::Device& device,
                 const DeviceInfo& info,
                 const ContextOptions& options);
  /// Gives up what no thread has begun and waits for the rest.
  ~ProgramBuilder();
  ProgramBuilder(const ProgramBuilder&) = delete;
  ProgramBuilder& operator=(const ProgramBuilder&) = delete;

  struct Build;

  /// Begins the program of the file `path` below cl/; with `fails` it ends as if the compiler had
  /// refused it. Throws DeviceError when there is no such file.
  std::shared_ptr<Build> begin(const std::string& path, const BuildOptions& options, bool fails);
  /// The program, once it is made; meanwhile this thread makes some of those that wait, its own
  /// first, unless processes do. Throws DeviceError with the compiler's log when the build fails,
  /// each time.
  cl::Program finish(const std::shared_ptr<Build>& build);
  /// Whether its build has failed.
  bool failed(const Build& build);

  /// Compiles a file below cl/ and leaves it in the cache, for another process that holds the
  /// cache's lock. Throws DeviceError as finish().
  void compile_for_cache(const std::string& path, const std::string& flags);

 private:
  void announce(Build& build);
  void work();
  /// Takes and gives back the mutex; `awaited` when this thread asks for the program.
  void run(Build& build,
           std::unique_lock<std::mutex>& lock,
           bool awaited,
           std::optional<CompilerProcess>& process);
  /// Calls `compiling` when it comes to that, which tells whether other programs are to be made.
  cl::Program make(const Build& build,
                   const std::function<bool()>& compiling,
                   std::optional<CompilerProcess>& process);
  cl::Program compile(const Build& build) const;
  std::optional<cl::Program> compile_apart(const Build& build,
                                           std::optional<CompilerProcess>& process);
  void store(const Build& build, const cl::Program& program) const;
  std::optional<cl::Program> from_cache(const Build& build) const;

  cl::Context context_;
  cl::Device device_;
  DeviceInfo info_;
  ContextOptions options_;
  ProgramCache cache_;
  bool driver_keeps_;  // compiled programs, so that the cache need not
  bool apart_;         // threads compile in processes of their own
  std::size_t most_threads_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::shared_ptr<Build>> queue_;
  std::size_t running_ = 0;
  std::size_t told_ = 0;  // programs that were announced
  bool ends_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace raysplats
