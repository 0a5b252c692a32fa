// SPDX-License-Identifier: Apache-2.0
// The kernel cache's tuning.json, looked up, changed and written again.
#include "device/tuning.hpp"

#include <cstdlib>

#include "fuzz/fuzz_target.hpp"

namespace raysplats::fuzz {
namespace {

void parse(std::span<const std::uint8_t> input) {
  scratch().write("tuning.json", input);
  TuningStore store(scratch().path().string());
  DeviceInfo device;
  device.name = "device";
  device.platform = "platform";
  device.driver_version = std::string("1");
  if (const auto found = store.find(device); found && !is_valid(*found)) std::abort();
  store.remove(device);
  store.store(device, {false, 8, 16, 32, 0});
  if (!TuningStore(scratch().path().string()).find(device)) std::abort();
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
