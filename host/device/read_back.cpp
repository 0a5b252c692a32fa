// SPDX-License-Identifier: Apache-2.0
#include "device/read_back.hpp"

#include "device/context_impl.hpp"

namespace raysplats {
namespace {

constexpr const char* kWhat = "Reading what a step needed";

}  // namespace

struct ReadBack::Impl {
  std::shared_ptr<std::vector<std::uint32_t>> words;
  cl::Event event;
};

ReadBack::ReadBack(Context& context, const Buffer<std::uint32_t>& buffer, std::size_t words)
    : impl_(std::make_unique<Impl>()) {
  impl_->words = std::make_shared<std::vector<std::uint32_t>>(words);
  Context::Impl& owner = context.impl();
  try {
    owner.queue.enqueueReadBuffer(buffer.raw().impl()->buffer, CL_FALSE, 0,
                                  words * sizeof(std::uint32_t), impl_->words->data(), nullptr,
                                  &impl_->event);
    owner.keep_until(impl_->event, impl_->words);
    owner.queue.flush();
  } catch (const cl::Error& error) {
    throw_cl_error(error, kWhat);
  }
}
ReadBack::~ReadBack() = default;
ReadBack::ReadBack(ReadBack&&) noexcept = default;
ReadBack& ReadBack::operator=(ReadBack&&) noexcept = default;

bool ReadBack::ready() const {
  try {
    return is_over(impl_->event);
  } catch (const cl::Error& error) {
    throw_cl_error(error, kWhat);
  }
}

const std::vector<std::uint32_t>& ReadBack::words() const {
  try {
    impl_->event.wait();
  } catch (const cl::Error& error) {
    throw_cl_error(error, kWhat);
  }
  return *impl_->words;
}

}  // namespace raysplats
