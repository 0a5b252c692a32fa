// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "bench/speed_model.hpp"

namespace raysplats {

/// A graphics card that nothing has run on: public figures (docs/speed_model.md) and what the
/// vendor's compiler says of the kernels (scripts/gpu/baseline.json).
struct Card {
  DeviceSpeeds speeds;
  std::string target;    ///< of scripts/gpu_compile.py, or the nearest one
  double units = 0;      ///< that share registers and local memory
  double registers = 0;  ///< of a unit, in waves' registers of 32 lanes; Intel: its threads
  double most = 0;       ///< waves of a unit
  double local = 0;      ///< bytes of a unit
  int granule = 1;       ///< registers are given out in
};

/// Radeon RX 7900 XTX, Arc A770, GeForce RTX 4090, H200 SXM.
const std::vector<Card>& cards();

/// Waves of 32 work-items of a kernel that the card holds at once.
double resident_waves(const Card& card, const CompiledKernel& kernel);

}  // namespace raysplats
