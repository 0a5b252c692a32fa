// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace raysplats {

/// A graphics card or accelerator on the PCI bus, whether or not it has a driver with OpenCL.
struct GraphicsCard {
  std::string address;  ///< "0000:01:00.0"
  std::string vendor;   ///< "NVIDIA", "AMD" or "Intel", else the vendor's number ("0x1af4")
  std::string driver;   ///< what brings OpenCL to it (docs/gpu.md); empty when that is not known
  std::string mesa;     ///< what Mesa's OpenCL calls its driver; empty where that is no choice
};

/// Every display controller and processing accelerator of `bus`, by address; none where the system
/// does not say it.
std::vector<GraphicsCard> graphics_cards(const std::filesystem::path& bus = "/sys/bus/pci/devices");

/// The files below `folder` by which drivers reach a card and which this user may not open.
std::vector<std::filesystem::path> closed_card_files(const std::filesystem::path& folder = "/dev");

}  // namespace raysplats
