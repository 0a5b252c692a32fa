// SPDX-License-Identifier: Apache-2.0
#include "device/row_download.hpp"

#include "device/context_impl.hpp"

namespace raysplats {
namespace {

constexpr const char* kWhat = "Reading the gradients of a view";

}  // namespace

struct RowDownload::Impl {
  std::vector<cl::Event> events;
};

RowDownload::RowDownload(Context& context,
                         std::span<const Buffer<float>* const> buffers,
                         const std::shared_ptr<std::vector<float>>& row)
    : impl_(std::make_unique<Impl>()) {
  Context::Impl& owner = context.impl();
  std::size_t numbers = 0;
  for (const Buffer<float>* buffer : buffers) numbers += buffer->size();
  row->resize(numbers);
  try {
    float* target = row->data();
    for (const Buffer<float>* buffer : buffers) {
      if (buffer->size() == 0) continue;
      owner.queue.enqueueReadBuffer(buffer->raw().impl()->buffer, CL_FALSE, 0,
                                    buffer->size() * sizeof(float), target, nullptr,
                                    &impl_->events.emplace_back());
      owner.keep_until(impl_->events.back(), row);
      target += buffer->size();
    }
    owner.queue.flush();
  } catch (const cl::Error& error) {
    throw_cl_error(error, kWhat);
  }
}
RowDownload::~RowDownload() = default;
RowDownload::RowDownload(RowDownload&&) noexcept = default;
RowDownload& RowDownload::operator=(RowDownload&&) noexcept = default;

void RowDownload::wait() const {
  try {
    if (!impl_->events.empty()) cl::Event::waitForEvents(impl_->events);
  } catch (const cl::Error& error) {
    throw_cl_error(error, kWhat);
  }
}

}  // namespace raysplats
