// SPDX-License-Identifier: Apache-2.0
#include "device/canaries.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr std::uint8_t kPattern = 0xa5;
constexpr std::uint8_t kUnset = 0xff;  // NaN as floats, absurd as indices
constexpr std::size_t kLeastBytes = 4096;

/// The index of the first byte that is not the pattern, or of the last one for `from_back`; `size`
/// when all are.
std::size_t first_change(const std::vector<std::uint8_t>& bytes, bool from_back) {
  const auto changed = [](std::uint8_t byte) { return byte != kPattern; };
  if (!from_back) {
    return static_cast<std::size_t>(std::find_if(bytes.begin(), bytes.end(), changed) -
                                    bytes.begin());
  }
  const auto last = std::find_if(bytes.rbegin(), bytes.rend(), changed);
  return last == bytes.rend() ? bytes.size() : static_cast<std::size_t>(bytes.rend() - last) - 1;
}

}  // namespace

std::unique_ptr<Canaries> Canaries::from_environment() {
  const char* text = std::getenv("RAYSPLATS_CANARY");
  if (text == nullptr || std::string_view(text).empty() || std::string_view(text) == "0") {
    return nullptr;
  }
  if (std::string_view(text) != "1") {
    throw UsageError(fmt::format("RAYSPLATS_CANARY is '{}': it must be 0 or 1", text));
  }
  return std::make_unique<Canaries>();
}

cl::Buffer Canaries::allocate(const cl::Context& context,
                              const cl::Device& device,
                              const cl::CommandQueue& queue,
                              std::size_t bytes,
                              const std::string& label) {
  // A part of a buffer begins at a multiple of the device's alignment, which is given in bits.
  const std::size_t alignment =
      std::max<std::size_t>(1, device.getInfo<CL_DEVICE_MEM_BASE_ADDR_ALIGN>() / 8);
  const std::size_t canary = (kLeastBytes + alignment - 1) / alignment * alignment;
  const cl::Buffer whole(context, CL_MEM_READ_WRITE, bytes + 2 * canary);
  queue.enqueueFillBuffer(whole, kPattern, 0, canary);
  queue.enqueueFillBuffer(whole, kUnset, canary, bytes);
  queue.enqueueFillBuffer(whole, kPattern, canary + bytes, canary);
  const cl_buffer_region region{canary, bytes};
  cl::Buffer part =
      cl::Buffer(whole).createSubBuffer(CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &region);
  guarded_.push_back({part, whole, canary, bytes, label});
  return part;
}

void Canaries::check(const cl::CommandQueue& queue, const std::string& what) {
  queue.finish();
  // Nobody else holds a buffer whose only reference is the one here.
  std::erase_if(guarded_, [](const Guarded& guarded) {
    return guarded.part.getInfo<CL_MEM_REFERENCE_COUNT>() <= 1;
  });
  std::vector<std::uint8_t> bytes;
  for (const Guarded& guarded : guarded_) {
    bytes.resize(guarded.canary);
    for (const bool before : {true, false}) {
      queue.enqueueReadBuffer(guarded.whole, CL_TRUE, before ? 0 : guarded.canary + guarded.bytes,
                              bytes.size(), bytes.data());
      const std::size_t change = first_change(bytes, before);
      if (change == bytes.size()) continue;
      throw DeviceError(fmt::format(
          "{} wrote {} bytes {} the buffer '{}' of {} bytes: report this with the command and the "
          "device's driver",
          what, before ? bytes.size() - change : change + 1, before ? "before" : "behind",
          guarded.label, guarded.bytes));
    }
  }
}

}  // namespace raysplats
