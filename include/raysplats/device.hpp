// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace raysplats {

/// What OpenCL calls a device.
enum class DeviceType { kCpu, kGpu, kAccelerator, kOther };

/// How camera rays are traced on a device: the choices that change the speed and nothing else.
struct DeviceTuning {
  bool grouped = false;    ///< packets are work-groups, not vectors
  int packet_width = 1;    ///< rays of a packet: 1, 2, 4, 8 or 16, in groups 8, 16, 32 or 64
  int tile = 16;           ///< pixels along a side of the tiles that share a candidate list
  int pending = 48;        ///< rows, or entries of a lane's sorted list, at once
  int group = 0;           ///< most work-items of a work-group; 0 = all packets of a tile
  bool bvh = false;        ///< camera rays walk the hierarchy one by one instead
  bool subgroups = false;  ///< of work-groups: each is one subgroup

  bool operator==(const DeviceTuning&) const = default;
};

/// What one OpenCL device offers, queried once.
struct DeviceInfo {
  std::size_t index = 0;         ///< position in list_devices(), the number `--device` takes
  std::string name;              ///< as the driver calls it
  std::string vendor;            ///< of the device
  std::string platform;          ///< name of its OpenCL platform
  std::string platform_version;  ///< OpenCL version string
  std::string version;           ///< OpenCL version string of the device
  std::string language_version;  ///< OpenCL C version string
  std::string driver_version;    ///< in the driver's own form
  DeviceType type = DeviceType::kOther;  ///< by OpenCL
  std::uint32_t compute_units = 0;       ///< processors that run work-groups
  std::uint64_t global_memory = 0;       ///< bytes; of a CPU no more than its container may take
  std::uint64_t max_allocation = 0;      ///< bytes of the largest single buffer
  std::uint64_t local_memory = 0;        ///< bytes per work-group
  std::size_t max_work_group_size = 0;   ///< work-items
  std::uint32_t float_vector_width = 1;  ///< native float lanes
  bool has_fp64 = false;                 ///< double precision, which no kernel needs
  bool has_int64_atomics = false;        ///< additions of 64-bit integers
  bool has_float_atomics = false;        ///< additions in global memory, by cl_ext_float_atomics
  bool has_subgroups = false;  ///< cl_khr_subgroups, or what became of it in OpenCL 2.1 and 3.0
  std::optional<DeviceTuning> tuning;  ///< of Context::device(): what `raysplats tune` found
  std::vector<std::string> problems;   ///< why the device cannot be used; empty when it can

  /// Whether a context can be made of it.
  bool usable() const { return problems.empty(); }
};

/// Every device of every installed platform, in the order the loader reports them.
/// An empty list means that no OpenCL platform is installed.
std::vector<DeviceInfo> list_devices();

/// The device that `selector` names: an index, a part of its name (case is ignored), or "" for the
/// first usable GPU, else the first usable CPU, else any usable device. A number that is no index
/// and has three digits or more is a part of the name too: "4090".
/// Throws DeviceError with the remedy when there is none, UsageError when the selector fits no
/// device.
DeviceInfo select_device(const std::string& selector);

}  // namespace raysplats
