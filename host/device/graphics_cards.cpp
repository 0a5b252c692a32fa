// SPDX-License-Identifier: Apache-2.0
#include "device/graphics_cards.hpp"

#include <unistd.h>

#include <algorithm>
#include <fstream>

namespace raysplats {
namespace {

namespace fs = std::filesystem;

// How PCI classes begin: display controllers and processing accelerators.
constexpr const char* kDisplay = "0x03";
constexpr const char* kAccelerator = "0x12";

struct Vendor {
  const char* number;
  const char* name;
  const char* driver;
  const char* mesa;
};
constexpr Vendor kVendors[] = {
    {"0x10de", "NVIDIA", "NVIDIA's driver with its OpenCL part (Debian: nvidia-opencl-icd)", ""},
    {"0x1002", "AMD", "ROCm's OpenCL (rocm-opencl-runtime of AMD's repository)", "radeonsi"},
    {"0x8086", "Intel", "Intel's compute runtime (Debian: intel-opencl-icd)", "iris"}};

std::string first_word(const fs::path& file) {
  std::ifstream stream(file);
  std::string word;
  stream >> word;
  return word;
}

}  // namespace

std::vector<GraphicsCard> graphics_cards(const fs::path& bus) {
  std::vector<GraphicsCard> cards;
  std::error_code error;
  for (fs::directory_iterator entry(bus, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string kind = first_word(entry->path() / "class");
    if (!kind.starts_with(kDisplay) && !kind.starts_with(kAccelerator)) continue;
    GraphicsCard card{entry->path().filename().string(), first_word(entry->path() / "vendor"), "",
                      ""};
    for (const Vendor& vendor : kVendors) {
      if (card.vendor != vendor.number) continue;
      card.vendor = vendor.name;
      card.driver = vendor.driver;
      card.mesa = vendor.mesa;
      break;
    }
    cards.push_back(std::move(card));
  }
  std::sort(cards.begin(), cards.end(),
            [](const GraphicsCard& a, const GraphicsCard& b) { return a.address < b.address; });
  return cards;
}

std::vector<fs::path> closed_card_files(const fs::path& folder) {
  std::vector<fs::path> candidates{folder / "kfd", folder / "nvidiactl"};
  std::error_code error;
  for (fs::directory_iterator entry(folder / "dri", error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().filename().string().starts_with("renderD"))
      candidates.push_back(entry->path());
  }
  std::vector<fs::path> closed;
  for (const fs::path& file : candidates) {
    if (fs::exists(file, error) && ::access(file.c_str(), R_OK | W_OK) != 0) closed.push_back(file);
  }
  std::sort(closed.begin(), closed.end());
  return closed;
}

}  // namespace raysplats
