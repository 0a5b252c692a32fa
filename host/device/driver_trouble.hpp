// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace raysplats {

/// Where the OpenCL loader looks for drivers, and the environment variable that says so (empty: the
/// loader's own folder).
struct DriverFolder {
  std::filesystem::path path;
  std::string variable;
};
DriverFolder driver_folder();

/// A driver is a line, the name of its library, in a file NAME.icd of the loader's folder.
struct RegisteredDriver {
  std::filesystem::path file;
  std::string library;
  std::string error;  ///< why the library cannot be loaded; empty when it can
};
/// All drivers of a folder by the names of their files; none where it cannot be read.
std::vector<RegisteredDriver> registered_drivers(const std::filesystem::path& folder);

/// Whether a platform of this name is PoCL's.
bool is_pocl(const std::string& platform);

/// Why the OpenCL loader finds no device, as one sentence with what to do: no driver is registered,
/// a driver's library cannot be loaded, or a driver has no place for its cache.
std::string why_no_devices();
/// The same of the platforms that the loader finds, by their names.
std::string why_no_devices(const std::vector<std::string>& platforms);

/// What is known to be wrong in results of a platform's driver, for the end of a sentence on its
/// device; empty when nothing is.
std::string known_fault(const std::string& platform, const std::string& driver_version);

/// What keeps the driver of a platform from compiling though the source is right, for the end of a
/// sentence: a cache folder that cannot be written, too little memory. Empty when nothing is found.
std::string driver_trouble(const std::string& platform);

/// Throws DeviceError for surroundings in which a driver ends the whole process.
void check_driver_surroundings();

}  // namespace raysplats
