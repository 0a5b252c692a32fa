// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "device/cl.hpp"
#include "device/container_memory.hpp"
#include "device/driver_trouble.hpp"
#include "device/platform.hpp"
#include "raysplats/error.hpp"
#include "util/ascii.hpp"
#include "util/number_text.hpp"

namespace raysplats {
namespace {

// The smallest work-group every launch can be cut down to.
constexpr std::size_t kMinWorkGroup = 64;
constexpr std::uint64_t kMinAllocation = 64ull << 20;
// Numbers in the names of cards, as in RTX 4090 and RX 580, have at least so many digits.
constexpr std::size_t kCardDigits = 3;

std::string trimmed(std::string text) {
  while (!text.empty() &&
         (text.back() == '\0' || std::isspace(static_cast<unsigned char>(text.back())))) {
    text.pop_back();
  }
  return text;
}

DeviceType type_of(cl_device_type type) {
  if (type & CL_DEVICE_TYPE_GPU) return DeviceType::kGpu;
  if (type & CL_DEVICE_TYPE_CPU) return DeviceType::kCpu;
  if (type & CL_DEVICE_TYPE_ACCELERATOR) return DeviceType::kAccelerator;
  return DeviceType::kOther;
}

std::vector<std::string> problems_of(const cl::Device& device, const DeviceInfo& info) {
  std::vector<std::string> problems;
  if (!device.getInfo<CL_DEVICE_AVAILABLE>())
    problems.emplace_back("the driver says it is not available");
  if (!device.getInfo<CL_DEVICE_COMPILER_AVAILABLE>())
    problems.emplace_back("it has no OpenCL C compiler");
  if (!device.getInfo<CL_DEVICE_ENDIAN_LITTLE>()) problems.emplace_back("it is big-endian");
  int major = 0;
  int minor = 0;
  if (std::sscanf(info.version.c_str(), "OpenCL %d.%d", &major, &minor) == 2 &&
      major * 10 + minor < 12) {
    problems.emplace_back("it offers less than OpenCL 1.2");
  }
  if (info.max_work_group_size < kMinWorkGroup) {
    problems.push_back(fmt::format("its work-groups hold {} work-items, {} are needed",
                                   info.max_work_group_size, kMinWorkGroup));
  }
  if (info.max_allocation < kMinAllocation) {
    problems.push_back(fmt::format("its largest buffer is {} MiB, {} MiB are needed",
                                   info.max_allocation >> 20, kMinAllocation >> 20));
  }
  if (std::string fault = known_fault(info.platform, info.driver_version); !fault.empty())
    problems.push_back(std::move(fault));
  return problems;
}

// Numbers of cl_ext_float_atomics, which some releases of the headers lack.
constexpr cl_device_info kFloatAtomicCapabilities = 0x4231;
constexpr cl_bitfield kGlobalFloatAdd = 1u << 1;

// Adding is one of several things that the extension may offer, in the language of OpenCL 3.0.
bool adds_floats(const cl::Device& device, const std::string& version) {
  cl_bitfield offered = 0;
  return version.starts_with("OpenCL 3.") &&
         clGetDeviceInfo(device.get(), kFloatAtomicCapabilities, sizeof offered, &offered,
                         nullptr) == CL_SUCCESS &&
         (offered & kGlobalFloatAdd) != 0;
}

// An extension, part of OpenCL 2.1 and 2.2, and optional again in 3.0.
bool has_subgroups(const cl::Device& device, const std::string& version, bool extension) {
  if (!version.starts_with("OpenCL 3."))
    return extension || version.starts_with("OpenCL 2.1") || version.starts_with("OpenCL 2.2");
  cl_uint most = 0;
  return clGetDeviceInfo(device.get(), CL_DEVICE_MAX_NUM_SUB_GROUPS, sizeof most, &most, nullptr) ==
             CL_SUCCESS &&
         most > 0;
}

DeviceInfo query(const cl::Platform& platform, const cl::Device& device) {
  DeviceInfo info;
  info.name = trimmed(device.getInfo<CL_DEVICE_NAME>());
  info.vendor = trimmed(device.getInfo<CL_DEVICE_VENDOR>());
  info.platform = trimmed(platform.getInfo<CL_PLATFORM_NAME>());
  info.platform_version = trimmed(platform.getInfo<CL_PLATFORM_VERSION>());
  info.version = trimmed(device.getInfo<CL_DEVICE_VERSION>());
  info.language_version = trimmed(device.getInfo<CL_DEVICE_OPENCL_C_VERSION>());
  info.driver_version = trimmed(device.getInfo<CL_DRIVER_VERSION>());
  info.type = type_of(device.getInfo<CL_DEVICE_TYPE>());
  info.compute_units = device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
  info.global_memory =
      memory_within_container(info.type, device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>());
  info.max_allocation = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
  info.local_memory = device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
  info.max_work_group_size = device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>();
  info.float_vector_width =
      std::max<std::uint32_t>(1, device.getInfo<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>());
  const std::string extensions = device.getInfo<CL_DEVICE_EXTENSIONS>();
  const auto has = [&](const char* name) { return extensions.find(name) != std::string::npos; };
  info.has_fp64 = has("cl_khr_fp64");
  info.has_int64_atomics = has("cl_khr_int64_base_atomics");
  info.has_float_atomics = has("cl_ext_float_atomics") && adds_floats(device, info.version);
  info.has_subgroups = has_subgroups(device, info.version, has("cl_khr_subgroups"));
  info.problems = problems_of(device, info);
  return info;
}

// One whose driver does not answer (a card that is lost) keeps its place in the list, so that the
// others keep their numbers.
DeviceInfo query_or_problem(const cl::Platform& platform, const cl::Device& device) {
  try {
    return query(platform, device);
  } catch (const cl::Error& error) {
    DeviceInfo info;
    info.name = "a device that does not answer";
    info.problems = {
        fmt::format("its driver does not say what it is ({} {})", error.what(), error.err())};
    return info;
  }
}

bool is_cpu(const cl::Device& device) {
  try {
    return type_of(device.getInfo<CL_DEVICE_TYPE>()) == DeviceType::kCpu;
  } catch (const cl::Error&) {
    return false;
  }
}

// The parts of a device that RAYSPLATS_CPU_PARTS asks for, else itself.
std::vector<cl::Device> parts_of(const cl::Device& device) {
  const char* text = std::getenv("RAYSPLATS_CPU_PARTS");
  if (text == nullptr || !is_cpu(device)) return {device};
  const std::string_view value(text);
  const cl_uint units = device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
  cl_uint parts = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), parts);
  if (error != std::errc() || end != value.data() + value.size() || parts < 1 || parts > units) {
    throw UsageError(
        fmt::format("RAYSPLATS_CPU_PARTS = '{}' cannot be: {} has {} compute units, give a number "
                    "from 1 to that",
                    value, trimmed(device.getInfo<CL_DEVICE_NAME>()), units));
  }
  if (parts == 1) return {device};
  const cl_device_partition_property equally[] = {
      CL_DEVICE_PARTITION_EQUALLY, static_cast<cl_device_partition_property>(units / parts), 0};
  std::vector<cl::Device> found;
  cl::Device whole = device;
  try {
    whole.createSubDevices(equally, &found);
  } catch (const cl::Error& failure) {
    throw UsageError(fmt::format(
        "RAYSPLATS_CPU_PARTS = {}: the driver of {} does not divide it "
        "({} {}); leave the variable out",
        parts, trimmed(device.getInfo<CL_DEVICE_NAME>()), failure.what(), failure.err()));
  }
  found.resize(parts);  // the last cores where the division leaves some
  return found;
}

}  // namespace

std::vector<PlatformDevice> platform_devices() {
  check_driver_surroundings();
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {
    return {};  // the loader reports "no platform" as an error (CL_PLATFORM_NOT_FOUND_KHR)
  }
  std::vector<PlatformDevice> found;
  for (const cl::Platform& platform : platforms) {
    std::vector<cl::Device> devices;
    try {
      platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
    } catch (const cl::Error&) {
      continue;  // a platform without devices is an error too
    }
    for (const cl::Device& device : devices) {
      for (const cl::Device& part : parts_of(device)) {
        DeviceInfo info = query_or_problem(platform, part);
        info.index = found.size();
        found.push_back({std::move(info), part});
      }
    }
  }
  return found;
}

std::vector<DeviceInfo> list_devices() {
  std::vector<DeviceInfo> infos;
  for (PlatformDevice& entry : platform_devices()) infos.push_back(std::move(entry.info));
  return infos;
}

DeviceInfo select_device(const std::string& selector) {
  const std::vector<DeviceInfo> devices = list_devices();
  if (devices.empty()) {
    throw DeviceError(why_no_devices());
  }
  return select_among(devices, selector);
}

DeviceInfo select_among(const std::vector<DeviceInfo>& devices, const std::string& selector) {
  if (selector.empty()) {
    for (const DeviceType wanted : {DeviceType::kGpu, DeviceType::kCpu}) {
      for (const DeviceInfo& info : devices) {
        if (info.type == wanted && info.usable()) return info;
      }
    }
    for (const DeviceInfo& info : devices) {
      if (info.usable()) return info;
    }
    throw DeviceError("No OpenCL device is usable: 'raysplats devices' says why for each");
  }
  const auto checked = [](const DeviceInfo& info) {
    if (!info.usable()) {
      throw DeviceError(
          fmt::format("Device {} ({}) is not usable: {}; choose another with --device", info.index,
                      info.name, fmt::join(info.problems, ", ")));
    }
    return info;
  };
  std::size_t index = 0;
  const auto [end, error] =
      std::from_chars(selector.data(), selector.data() + selector.size(), index);
  const bool number = error == std::errc() && end == selector.data() + selector.size();
  if (number && index < devices.size()) return checked(devices[index]);
  // A number of fewer digits is an index that was mistaken, however many names have its digits.
  if (!number || selector.size() >= kCardDigits) {
    for (const DeviceInfo& info : devices) {
      if (ascii_lower(info.name).find(ascii_lower(selector)) != std::string::npos)
        return checked(info);
    }
  }
  if (number) {
    throw UsageError(fmt::format(
        "--device {}: there {} {}, counted from 0{}; 'raysplats devices' lists them", selector,
        devices.size() == 1 ? "is" : "are", counted(static_cast<double>(devices.size()), "device"),
        selector.size() >= kCardDigits ? ", and none has that in its name" : ""));
  }
  throw UsageError(fmt::format(
      "--device {}: no device has that in its name; 'raysplats devices' lists them", selector));
}

}  // namespace raysplats
