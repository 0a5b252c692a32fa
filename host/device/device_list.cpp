// SPDX-License-Identifier: Apache-2.0
#include "device/device_list.hpp"

#include <fmt/format.h>

#include <string_view>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

std::vector<std::string_view> split(std::string_view list) {
  std::vector<std::string_view> parts;
  for (;;) {
    const std::size_t comma = list.find(',');
    parts.push_back(list.substr(0, comma));
    if (comma == list.npos) return parts;
    list.remove_prefix(comma + 1);
  }
}

}  // namespace

std::vector<DeviceInfo> select_devices(const std::string& selectors) {
  std::vector<DeviceInfo> out;
  for (const std::string_view one : split(selectors)) {
    if (one.empty() && !selectors.empty())
      throw UsageError(fmt::format("--device {} names nothing beside a comma", selectors));
    out.push_back(select_device(std::string(one)));
  }
  return out;
}

std::vector<DeviceInfo> devices_like(const DeviceInfo& device) {
  std::vector<DeviceInfo> out = list_devices();
  std::erase_if(out, [&](const DeviceInfo& other) {
    return other.type != device.type || other.name != device.name || !other.usable();
  });
  return out;
}

}  // namespace raysplats
