// SPDX-License-Identifier: Apache-2.0
#include "device/driver_trouble.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <vector>

#include "device/cl.hpp"
#include "raysplats/error.hpp"
#include "util/memory_limit.hpp"
#include "util/output_directory.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

// Nothing when the library loads.
std::string load_error(const std::string& library) {
  void* handle = ::dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) return ::dlerror();
  ::dlclose(handle);
  return "";
}

}  // namespace

DriverFolder driver_folder() {
  for (const char* name : {"OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH"}) {
    if (const std::string chosen = variable(name); !chosen.empty()) return {chosen, name};
  }
  return {"/etc/OpenCL/vendors", ""};
}

std::vector<RegisteredDriver> registered_drivers(const std::filesystem::path& folder) {
  std::vector<RegisteredDriver> drivers;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().extension() != ".icd") continue;
    RegisteredDriver driver{entry->path(), "", ""};
    std::ifstream stream(driver.file);
    std::getline(stream, driver.library);
    driver.error = load_error(driver.library);
    drivers.push_back(std::move(driver));
  }
  std::sort(drivers.begin(), drivers.end(),
            [](const RegisteredDriver& a, const RegisteredDriver& b) { return a.file < b.file; });
  return drivers;
}

namespace {

// The folder that PoCL keeps compiled kernels in, and the variable that names it.
struct PoclCache {
  std::string variable;
  fs::path folder;
};

PoclCache pocl_cache() {
  if (std::getenv("POCL_CACHE_DIR") != nullptr)
    return {"POCL_CACHE_DIR", variable("POCL_CACHE_DIR")};
  if (const std::string cache = variable("XDG_CACHE_HOME"); !cache.empty())
    return {"XDG_CACHE_HOME", fs::path(cache) / "pocl" / "kcache"};
  if (const std::string home = variable("HOME"); !home.empty())
    return {"HOME", fs::path(home) / ".cache" / "pocl" / "kcache"};
  return {"", "/tmp/pocl/kcache"};
}

// "the folder F of its cache, by VARIABLE, cannot be written (reason)"; empty when it can.
std::string pocl_cache_trouble() {
  const PoclCache cache = pocl_cache();
  const std::error_code error = writing_trouble(cache.folder);
  if (!error) return "";
  return fmt::format("the folder {}{} of its cache cannot be written ({})", cache.folder.string(),
                     cache.variable.empty() ? "" : fmt::format(" ({})", cache.variable),
                     error.message());
}

std::vector<std::string> platform_names() {
  std::vector<std::string> names;
  try {
    std::vector<cl::Platform> platforms;
    cl::Platform::get(&platforms);
    for (const cl::Platform& platform : platforms)
      names.push_back(platform.getInfo<CL_PLATFORM_NAME>());
  } catch (const cl::Error&) {  // how the loader says that there is none
  }
  return names;
}

std::string why_no_platforms() {
  const DriverFolder folder = driver_folder();
  const std::vector<RegisteredDriver> drivers = registered_drivers(folder.path);
  for (const RegisteredDriver& driver : drivers) {
    if (driver.error.empty()) continue;
    const std::string remark = memory_limit_remark();
    return fmt::format("The OpenCL driver of {} cannot be loaded ({}){}: {}", driver.file.string(),
                       driver.error, remark,
                       remark.empty() ? "install it anew" : "allow it more, or install it anew");
  }
  if (drivers.empty() && !folder.variable.empty()) {
    return fmt::format(
        "No OpenCL platform is registered in {}, which {} names: unset it, or install "
        "pocl-opencl-icd "
        "to run on the CPU",
        folder.path.string(), folder.variable);
  }
  if (!drivers.empty()) {
    return fmt::format("The OpenCL driver of {} offers no platform here: install another driver",
                       drivers.front().file.string());
  }
  return "No OpenCL platform is installed: install your GPU's OpenCL driver, or pocl-opencl-icd to "
         "run on the CPU";
}

}  // namespace

bool is_pocl(const std::string& platform) {
  return platform.find("Portable Computing Language") != std::string::npos;
}

std::string known_fault(const std::string& platform, const std::string& driver_version) {
  // Loops end after 65 535 turns, and a box of a tree may stand in two places.
  if (platform == "rusticl" && driver_version.starts_with("22."))
    return fmt::format("Mesa {} computes wrongly, from 25.0 on it does not", driver_version);
  return "";
}

std::string why_no_devices() { return why_no_devices(platform_names()); }

std::string why_no_devices(const std::vector<std::string>& platforms) {
  if (platforms.empty()) return why_no_platforms();
  for (const std::string& platform : platforms) {
    if (!is_pocl(platform)) continue;
    if (const std::string trouble = pocl_cache_trouble(); !trouble.empty()) {
      return fmt::format("The OpenCL platform {} offers no device: {}; name one by POCL_CACHE_DIR",
                         platform, trouble);
    }
    if (const std::string only = variable("POCL_DEVICES"); !only.empty()) {
      return fmt::format("The OpenCL platform {} offers no device: POCL_DEVICES is '{}', unset it",
                         platform, only);
    }
  }
  if (std::find(platforms.begin(), platforms.end(), "rusticl") != platforms.end()) {
    const std::string only = variable("RUSTICL_ENABLE");
    return fmt::format(
        "The OpenCL platform {} offers no device{}: set RUSTICL_ENABLE to the driver of your card, "
        "radeonsi (AMD) or iris (Intel), or install pocl-opencl-icd to run on the CPU",
        fmt::join(platforms, ", "),
        only.empty() ? "" : fmt::format(" with RUSTICL_ENABLE={}", only));
  }
  return fmt::format(
      "The OpenCL platform {} offers no device{}: 'clinfo' shows what its driver finds",
      fmt::join(platforms, ", "), memory_limit_remark());
}

std::string driver_trouble(const std::string& platform) {
  if (const std::string trouble = is_pocl(platform) ? pocl_cache_trouble() : ""; !trouble.empty())
    return trouble + ", name one by POCL_CACHE_DIR";
  const std::string remark = memory_limit_remark();
  return remark.empty() ? "" : remark.substr(2) + ", allow it more or update the driver";
}

void check_driver_surroundings() {
  // PoCL aborts.
  if (std::getenv("POCL_CACHE_DIR") != nullptr && variable("POCL_CACHE_DIR").empty())
    throw DeviceError("POCL_CACHE_DIR is empty: name a folder by it, or unset it");
}

}  // namespace raysplats
