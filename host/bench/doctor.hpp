// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bench/self_test.hpp"
#include "device/context.hpp"
#include "device/driver_trouble.hpp"
#include "device/graphics_cards.hpp"
#include "device/program_cache.hpp"
#include "raysplats/device.hpp"

namespace raysplats {

/// How a device fared.
struct DeviceVerdict {
  DeviceInfo device;
  bool works = false;
  std::string text;            ///< "works", or what is wrong with it
  std::string trouble;         ///< as driver_trouble() when the driver failed; else empty
  double seconds = 0;          ///< of the self-test, without compiling
  double compile_seconds = 0;  ///< of its kernels
  std::vector<SelfTestCheck> checks;
};

/// "works", or the checks that failed with error and limit.
std::string verdict_on(const std::vector<SelfTestCheck>& checks);

/// What this computer offers to run on, and what is wrong with it.
struct Diagnosis {
  DriverFolder folder;
  std::vector<RegisteredDriver> drivers;
  std::vector<GraphicsCard> cards;
  std::vector<std::filesystem::path> closed_files;  ///< of cards, which this user may not open
  std::string process_limit;                        ///< as memory_limit_remark(); empty when none
  std::filesystem::path cache;
  ProgramCacheState cache_state;
  std::vector<DeviceVerdict> devices;
  std::vector<std::string> advice;  ///< a sentence each; empty when all is well

  bool any_works() const;
};

/// Looks at drivers, limits and caches, and runs the self-test on every usable device in the
/// context that `open` makes. What is wrong, exceptions of `open` included, is part of the result.
using ContextOpener = std::function<std::unique_ptr<Context>(const DeviceInfo&)>;
Diagnosis diagnose(const ContextOpener& open);

/// What to do about a diagnosis whose other fields are filled in.
std::vector<std::string> advice_on(const Diagnosis& diagnosis);

std::string diagnosis_text(const Diagnosis& diagnosis);
std::string diagnosis_json(const Diagnosis& diagnosis);

}  // namespace raysplats
