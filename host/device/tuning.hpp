// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "raysplats/device.hpp"

namespace raysplats {

/// What `raysplats tune` found on this computer's devices: one JSON file beside the compiled
/// programs. An entry holds for one device name, platform, driver version and version of RaySplats.
class TuningStore {
 public:
  /// "" = the directory of the kernel cache. Without any directory nothing is found. A file that
  /// cannot be understood is ignored with a warning.
  explicit TuningStore(const std::string& directory = "");

  /// The entry that holds for a device, or nothing.
  std::optional<DeviceTuning> find(const DeviceInfo& device) const;
  /// Replaces that entry; the file changes as a whole. Throws DataError when it cannot be written.
  void store(const DeviceInfo& device, const DeviceTuning& tuning);
  /// Removes the device's entries of all versions from the file and returns how many there were.
  std::size_t remove(const DeviceInfo& device);

  const std::filesystem::path& path() const { return path_; }

  struct Entry {
    std::string device;
    std::string platform;
    std::string driver;
    std::string version;  ///< of RaySplats
    DeviceTuning tuning;
  };

 private:
  std::filesystem::path path_;  // empty = no directory
  std::vector<Entry> entries_;
};

/// Whether tracing can be built like that: a packet width of 1, 2, 4, 8 or 16, a tile of 8, 16, 32
/// or 64 pixels, 1 to 1024 pending entries, and a group of 0 (the whole tile) or more.
/// "vector", "group" or "subgroup".
const char* packet_shape_of(const DeviceTuning& tuning);

bool is_valid(const DeviceTuning& tuning);

}  // namespace raysplats
