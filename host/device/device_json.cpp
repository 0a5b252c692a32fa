// SPDX-License-Identifier: Apache-2.0
#include "device/device_json.hpp"

#include "device/tuning.hpp"

namespace raysplats {

const char* device_type_name(DeviceType type) {
  switch (type) {
    case DeviceType::kCpu:
      return "CPU";
    case DeviceType::kGpu:
      return "GPU";
    case DeviceType::kAccelerator:
      return "accelerator";
    case DeviceType::kOther:
      break;
  }
  return "other";
}

nlohmann::ordered_json device_json(const DeviceInfo& device) {
  nlohmann::ordered_json tuning;
  if (device.tuning) {
    tuning = {{"packet_shape", packet_shape_of(*device.tuning)},
              {"packet_width", device.tuning->packet_width},
              {"tile", device.tuning->tile},
              {"pending", device.tuning->pending},
              {"group", device.tuning->group},
              {"bvh", device.tuning->bvh}};
  }
  return {{"index", device.index},
          {"name", device.name},
          {"vendor", device.vendor},
          {"type", device_type_name(device.type)},
          {"platform", device.platform},
          {"platform_version", device.platform_version},
          {"version", device.version},
          {"language_version", device.language_version},
          {"driver_version", device.driver_version},
          {"compute_units", device.compute_units},
          {"float_vector_width", device.float_vector_width},
          {"max_work_group_size", device.max_work_group_size},
          {"global_memory", device.global_memory},
          {"max_allocation", device.max_allocation},
          {"local_memory", device.local_memory},
          {"fp64", device.has_fp64},
          {"float_atomics", device.has_float_atomics},
          {"int64_atomics", device.has_int64_atomics},
          {"subgroups", device.has_subgroups},
          {"tuning", tuning},
          {"usable", device.usable()},
          {"problems", device.problems}};
}

}  // namespace raysplats
