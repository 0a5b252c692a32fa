// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "device/cl.hpp"

namespace raysplats {

/// Words of a known pattern before and behind every buffer of a context, to find kernels that write
/// outside their buffers on any device. The buffers themselves begin as NaN, so that results which
/// depend on memory that was never written cannot pass for right. On when RAYSPLATS_CANARY=1 as the
/// context is opened; every launch is then waited for and followed by a look at all of them, which
/// is slow.
class Canaries {
 public:
  /// Nothing unless RAYSPLATS_CANARY is 1. Throws UsageError when it is neither 0 nor 1.
  static std::unique_ptr<Canaries> from_environment();

  /// Memory between two canaries, as a part of a larger buffer. Throws cl::Error.
  cl::Buffer allocate(const cl::Context& context,
                      const cl::Device& device,
                      const cl::CommandQueue& queue,
                      std::size_t bytes,
                      const std::string& label);

  /// Waits for the queue and throws DeviceError when a canary of a living buffer has changed;
  /// `what` begins the sentence and `label` of the buffer ends it.
  void check(const cl::CommandQueue& queue, const std::string& what);

 private:
  // NOLINTNEXTLINE(bugprone-exception-escape): a release that OpenCL refuses ends the program
  struct Guarded {
    cl::Buffer part;   // what the user of the buffer has
    cl::Buffer whole;  // with the canaries
    std::size_t canary;
    std::size_t bytes;
    std::string label;
  };
  std::vector<Guarded> guarded_;
};

}  // namespace raysplats
