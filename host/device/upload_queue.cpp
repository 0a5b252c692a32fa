// SPDX-License-Identifier: Apache-2.0
#include "device/upload_queue.hpp"

#include <spdlog/spdlog.h>

#include <cstring>
#include <list>
#include <vector>

#include "device/context_impl.hpp"

namespace raysplats {
namespace {

// Memory in which words wait for their copy, and the last copy out of it.
struct Stage {
  cl::Buffer buffer;
  std::size_t bytes = 0;
  void* mapped = nullptr;
  cl::Event copied;
};

}  // namespace

struct UploadQueue::Moment::Impl {
  cl::Event event;
};

struct UploadQueue::Impl {
  explicit Impl(Context& context) : owner(context.impl()) {}

  // One that no copy reads any more; a new one where all are in use.
  Stage& free_stage(std::size_t bytes) {
    for (Stage& stage : stages) {
      if (stage.copied() != nullptr && !is_over(stage.copied)) continue;
      if (stage.bytes >= bytes) return stage;
      unmap(stage);
      map(stage, bytes);
      return stage;
    }
    map(stages.emplace_back(), bytes);
    return stages.back();
  }
  void map(Stage& stage, std::size_t bytes) {
    stage.bytes = 0;
    stage.buffer = cl::Buffer(owner.context, CL_MEM_READ_ONLY | CL_MEM_ALLOC_HOST_PTR, bytes);
    stage.mapped = queue.enqueueMapBuffer(stage.buffer, CL_TRUE, CL_MAP_WRITE, 0, bytes);
    stage.bytes = bytes;
  }
  void unmap(Stage& stage) {
    if (stage.mapped != nullptr) queue.enqueueUnmapMemObject(stage.buffer, stage.mapped);
    stage.mapped = nullptr;
  }

  Context::Impl& owner;
  cl::CommandQueue queue;
  std::list<Stage> stages;
};

UploadQueue::Moment::Moment() = default;
UploadQueue::Moment::~Moment() = default;
UploadQueue::Moment::Moment(Moment&&) noexcept = default;
UploadQueue::Moment& UploadQueue::Moment::operator=(Moment&&) noexcept = default;

UploadQueue::UploadQueue(Context& context) : impl_(std::make_unique<Impl>(context)) {
  try {
    impl_->queue = cl::CommandQueue(impl_->owner.context, impl_->owner.device);
  } catch (const cl::Error& error) {
    throw_cl_error(error, "Opening a queue for uploads on " + impl_->owner.info.name);
  }
}

UploadQueue::~UploadQueue() {
  if (!impl_) return;
  try {
    for (Stage& stage : impl_->stages) impl_->unmap(stage);
    impl_->queue.finish();
  } catch (const cl::Error& error) {
    spdlog::debug("closing the queue for uploads: {}", cl_error_name(error.err()));
  }
}
UploadQueue::UploadQueue(UploadQueue&&) noexcept = default;
UploadQueue& UploadQueue::operator=(UploadQueue&&) noexcept = default;

UploadQueue::Moment UploadQueue::moment() {
  Moment out;
  out.impl_ = std::make_unique<Moment::Impl>();
  try {
    impl_->owner.queue.enqueueMarkerWithWaitList(nullptr, &out.impl_->event);
  } catch (const cl::Error& error) {
    throw_cl_error(error, "Marking a moment on " + impl_->owner.info.name);
  }
  return out;
}

void UploadQueue::upload(std::span<const std::uint32_t> source,
                         Buffer<std::uint32_t>& target,
                         const Moment& free) {
  if (source.empty()) return;
  Impl& self = *impl_;
  const std::size_t bytes = source.size_bytes();
  try {
    // What one queue waits for has to be on its way in the other.
    if (free.impl_) self.owner.queue.flush();
    Stage& stage = self.free_stage(bytes);
    std::memcpy(stage.mapped, source.data(), bytes);
    std::vector<cl::Event> after;
    if (free.impl_) after.push_back(free.impl_->event);
    self.queue.enqueueWriteBuffer(target.raw().impl()->buffer, CL_FALSE, 0, bytes, stage.mapped,
                                  &after, &stage.copied);
    self.queue.flush();
    const std::vector<cl::Event> copied{stage.copied};
    self.owner.queue.enqueueBarrierWithWaitList(&copied);
  } catch (const cl::Error& error) {
    throw_cl_error(error, "Uploading to " + self.owner.info.name);
  }
}

}  // namespace raysplats
