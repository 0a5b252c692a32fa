// SPDX-License-Identifier: Apache-2.0
#include "device/device_list.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "raysplats/error.hpp"
#include "util/ascii.hpp"

namespace raysplats {
namespace {

// Which are places in the list of devices, not parts of names.
bool is_number(const std::string& text) {
  return std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace

std::vector<std::string> device_selectors(const std::string& list,
                                          std::span<const std::string> names) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    parts.push_back(list.substr(begin, end - begin));
    begin = end + 1;
  }
  std::vector<std::string> out;
  for (std::size_t first = 0, last = 0; first < parts.size(); first = last) {
    last = parts.size();
    std::string whole;
    for (; last > first + 1; --last) {
      whole = fmt::format("{}", fmt::join(parts.begin() + static_cast<std::ptrdiff_t>(first),
                                          parts.begin() + static_cast<std::ptrdiff_t>(last), ","));
      const bool named = !is_number(parts[first]) && !parts[last - 1].empty() &&
                         std::ranges::any_of(names, [&](const std::string& name) {
                           return ascii_lower(name).find(ascii_lower(whole)) != std::string::npos;
                         });
      if (named) break;
    }
    out.push_back(last > first + 1 ? whole : parts[first]);
    if (out.back().empty() && !list.empty())
      throw UsageError(fmt::format("--device {} names nothing beside a comma", list));
  }
  return out;
}

std::vector<DeviceInfo> select_devices(const std::string& selectors) {
  std::vector<std::string> names;
  if (selectors.find(',') != std::string::npos) {
    for (const DeviceInfo& device : list_devices()) names.push_back(device.name);
  }
  std::vector<DeviceInfo> out;
  for (const std::string& one : device_selectors(selectors, names))
    out.push_back(select_device(one));
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
