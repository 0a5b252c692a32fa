// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "device/context.hpp"

namespace raysplats {

/// Copies words to the device beside what it runs: on a queue of its own, from memory that the
/// driver keeps in place for that (CL_MEM_ALLOC_HOST_PTR, mapped). Nothing waits on the host.
class UploadQueue {
 public:
  /// Everything that was enqueued in the context before this was made.
  class Moment {
   public:
    Moment();
    ~Moment();
    Moment(Moment&&) noexcept;
    Moment& operator=(Moment&&) noexcept;

   private:
    friend class UploadQueue;
    struct Impl;
    std::unique_ptr<Impl> impl_;  // none: nothing
  };

  /// Throws DeviceError when the driver has no second queue.
  explicit UploadQueue(Context& context);
  ~UploadQueue();
  UploadQueue(UploadQueue&&) noexcept;
  UploadQueue& operator=(UploadQueue&&) noexcept;

  /// Now, in the order of the context's commands.
  Moment moment();
  /// Copies `source`, which is free again at once, to the first elements of `target`, after `free`,
  /// the moment from which on nothing that runs uses the target. Everything that is enqueued later
  /// finds it there. Throws DeviceError when the driver refuses.
  void upload(std::span<const std::uint32_t> source,
              Buffer<std::uint32_t>& target,
              const Moment& free);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
