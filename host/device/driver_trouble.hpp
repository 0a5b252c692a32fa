// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace raysplats {

/// Why the OpenCL loader finds no device, as one sentence with what to do: no driver is registered,
/// a driver's library cannot be loaded, or a driver has no place for its cache.
std::string why_no_devices();

/// What keeps a driver from compiling though the source is right, for the end of a sentence: a
/// cache folder that cannot be written, too little memory. Empty when nothing is found.
std::string driver_trouble();

/// Throws DeviceError for surroundings in which a driver ends the whole process.
void check_driver_surroundings();

}  // namespace raysplats
