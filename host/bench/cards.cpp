// SPDX-License-Identifier: Apache-2.0
#include "bench/cards.hpp"

#include <algorithm>
#include <cmath>

namespace raysplats {
namespace {

constexpr double kWave = 32;  // work-items of a wave that counts are given for

// The cards, at the highest clocks that the makers state. Caches: sizes as the makers state them,
// rates as others measured them.
std::vector<Card> make_cards() {
  constexpr double kGiga = 1e9, kMega = 1024.0 * 1024.0;
  std::vector<Card> out(4);
  Card& amd = out[0];
  amd.speeds = {.name = "RX 7900 XTX",
                .vectors = 96 * 2 * 2.5 * kGiga,  // 96 units of two SIMD32
                .scalars = 96 * 2 * 2.5 * kGiga,
                .slow = 96 * 2 * 2.5 * kGiga / 4,
                .bandwidth = {{96 * kMega, 3500 * kGiga}, {INFINITY, 960 * kGiga}},
                .lines = {},
                .runs = {},
                .chases = {},
                .tiled = {},
                .stores = {},
                .local = 96 * 2.5 * kGiga,
                .atomics = 64 * 2.5 * kGiga,
                .clock = 2.5 * kGiga,
                .issue_cycles = 5,
                .trip_cycles = 300,
                .local_cycles = 30,
                .launch_seconds = 5e-6};
  amd.target = "gfx1100";
  amd.units = 192;  // SIMDs
  amd.registers = 1536;
  amd.most = 16;
  amd.local = 32 * 1024;  // of 128 kB that four SIMDs share
  amd.granule = 24;
  Card& intel = out[1];
  intel.speeds = {.name = "Arc A770",
                  .vectors = 512 * 8 / kWave * 2.1 * kGiga,  // 512 engines of 8 lanes
                  .slow = 512 * 8 / kWave * 2.1 * kGiga / 4,
                  .bandwidth = {{16 * kMega, 2000 * kGiga}, {INFINITY, 560 * kGiga}},
                  .lines = {},
                  .runs = {},
                  .chases = {},
                  .tiled = {},
                  .stores = {},
                  .local = 32 * 2.1 * kGiga,
                  .atomics = 32 * 2.1 * kGiga,
                  .clock = 2.1 * kGiga,
                  .issue_cycles = 10,
                  .trip_cycles = 500,
                  .local_cycles = 60,
                  .launch_seconds = 10e-6};
  intel.target = "dg2-g10";
  intel.units = 32;                // Xe cores
  intel.registers = 128 * 16 * 8;  // 128 in each of 8 threads of 16 engines
  intel.most = 128;
  intel.local = 128 * 1024;
  Card& ada = out[2];
  ada.speeds = {.name = "RTX 4090",
                .vectors = 128 * 4 * 2.52 * kGiga,  // 128 multiprocessors
                .slow = 128 * 0.5 * 2.52 * kGiga,
                .bandwidth = {{72 * kMega, 5000 * kGiga}, {INFINITY, 1008 * kGiga}},
                .lines = {},
                .runs = {},
                .chases = {},
                .tiled = {},
                .stores = {},
                .local = 128 * 2.52 * kGiga,
                .atomics = 64 * 2.52 * kGiga,
                .clock = 2.52 * kGiga,
                .issue_cycles = 4,
                .trip_cycles = 300,
                .local_cycles = 25,
                .launch_seconds = 5e-6};
  ada.target = "sm_86";  // of compilers at hand; the same registers, local memory and waves
  ada.units = 128;
  ada.registers = 2048;
  ada.most = 48;
  ada.local = 100 * 1024;
  ada.granule = 8;
  Card& hopper = out[3];
  hopper.speeds = {.name = "H200",
                   .vectors = 132 * 4 * 1.98 * kGiga,
                   .slow = 132 * 0.5 * 1.98 * kGiga,
                   .bandwidth = {{50 * kMega, 5500 * kGiga}, {INFINITY, 4800 * kGiga}},
                   .lines = {},
                   .runs = {},
                   .chases = {},
                   .tiled = {},
                   .stores = {},
                   .local = 132 * 1.98 * kGiga,
                   .atomics = 64 * 1.98 * kGiga,
                   .clock = 1.98 * kGiga,
                   .issue_cycles = 4,
                   .trip_cycles = 280,
                   .local_cycles = 25,
                   .launch_seconds = 5e-6};
  hopper.target = "sm_90";
  hopper.units = 132;
  hopper.registers = 2048;
  hopper.most = 64;
  hopper.local = 227 * 1024;
  hopper.granule = 8;
  return out;
}

}  // namespace

const std::vector<Card>& cards() {
  static const std::vector<Card> all = make_cards();
  return all;
}

double resident_waves(const Card& card, const CompiledKernel& kernel) {
  const double waves_of_group = std::max(1.0, kernel.group / kernel.width);
  const double registers = std::ceil(kernel.registers / card.granule) * card.granule;
  double waves = std::min(card.most, std::floor(card.registers / registers));
  if (kernel.local > 0)
    waves = std::min(waves, std::floor(card.local / kernel.local * waves_of_group));
  return std::max(waves, 1.0) * card.units * kernel.width / kWave;
}

}  // namespace raysplats
