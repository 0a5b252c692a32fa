// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "device/cl.hpp"
#include "device/context.hpp"
#include "device/profiler.hpp"

namespace raysplats {

/// Bytes in buffers; shared with them, so that one may go after its context.
struct MemoryCount {
  std::size_t allocated = 0;
  std::size_t peak = 0;
};

struct Context::Impl {
  DeviceInfo info;
  ContextOptions options;
  cl::Device device;
  cl::Context context;
  cl::CommandQueue queue;
  Profiler profiler;
  std::map<std::string, cl::Program> programs;             // by program path and build options
  std::vector<std::pair<std::string, cl::Event>> pending;  // launches whose times are not read yet
  std::shared_ptr<MemoryCount> memory = std::make_shared<MemoryCount>();

  cl::Program& program(const std::string& path, const BuildOptions& build);
  void collect_profile();
};

struct Kernel::Impl {
  Context::Impl* context = nullptr;
  cl::Kernel kernel;
  std::string name;
  unsigned argument_count = 0;
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
/// RAYSPLATS_KERNEL_DIR when that is set), each file once, with #line marks.
std::string resolve_kernel_source(const std::string& path);

}  // namespace raysplats
