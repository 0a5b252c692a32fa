// SPDX-License-Identifier: Apache-2.0
#include "bench/doctor.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <nlohmann/json.hpp>
#include <string_view>

#include "device/context.hpp"
#include "device/device_json.hpp"
#include "util/json_text.hpp"
#include "util/memory_limit.hpp"
#include "util/number_text.hpp"

namespace raysplats {
namespace {

/// Where a remark on the process's limit begins, which continues a sentence: "; this process ...".
constexpr std::size_t kRemark = 2;

DeviceVerdict examine(const DeviceInfo& device, const ContextOpener& open) {
  DeviceVerdict verdict;
  verdict.device = device;
  if (!device.usable()) {
    verdict.text = fmt::format("not usable: {}", fmt::join(device.problems, ", "));
    return verdict;
  }
  try {
    const std::unique_ptr<Context> opened = open(device);
    Context& context = *opened;
    const auto begin = std::chrono::steady_clock::now();
    verdict.checks = run_self_test(context, {});
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    verdict.compile_seconds = context.build_seconds();
    verdict.seconds = spent.count() - verdict.compile_seconds;
    verdict.text = verdict_on(verdict.checks);
    verdict.works = std::all_of(verdict.checks.begin(), verdict.checks.end(),
                                [](const SelfTestCheck& check) { return check.passed(); });
  } catch (const std::exception& error) {  // whatever its driver came up with
    verdict.text = fmt::format("fails: {}", error.what());
    verdict.trouble = driver_trouble(device.platform);
  }
  return verdict;
}

/// The vendor of a card as its devices' names and platforms have it.
bool has_device(const Diagnosis& diagnosis, const std::string& vendor) {
  return std::any_of(
      diagnosis.devices.begin(), diagnosis.devices.end(), [&](const DeviceVerdict& verdict) {
        const DeviceInfo& device = verdict.device;
        return device.type != DeviceType::kCpu &&
               (device.vendor + device.name + device.platform).find(vendor) != std::string::npos;
      });
}

/// Mesa's OpenCL offers only cards whose drivers a variable names.
std::string or_mesa(const Diagnosis& diagnosis, const GraphicsCard& card) {
  const bool present =
      std::any_of(diagnosis.drivers.begin(), diagnosis.drivers.end(), [](const auto& driver) {
        return driver.error.empty() && driver.library.find("Rusticl") != std::string::npos;
      });
  const char* enabled = std::getenv("RUSTICL_ENABLE");
  if (!present || card.mesa.empty() ||
      (enabled != nullptr && std::string_view(enabled).find(card.mesa) != std::string_view::npos)) {
    return "";
  }
  return fmt::format(", or set RUSTICL_ENABLE={}: Mesa's OpenCL is here", card.mesa);
}

constexpr double kMebibyte = 1024.0 * 1024.0;

std::string size_text(std::uint64_t bytes) {
  if (bytes < std::uint64_t{1} << 20) return fmt::format("{} KiB", bytes >> 10);
  return fmt::format("{:.0f} MiB", static_cast<double>(bytes) / kMebibyte);
}

}  // namespace

bool Diagnosis::any_works() const {
  return std::any_of(devices.begin(), devices.end(),
                     [](const DeviceVerdict& verdict) { return verdict.works; });
}

std::string verdict_on(const std::vector<SelfTestCheck>& checks) {
  std::vector<std::string> wrong;
  for (const SelfTestCheck& check : checks) {
    if (!check.passed())
      wrong.push_back(fmt::format("{} {:.1e} of {:.0e}", check.name, check.error, check.limit));
  }
  if (wrong.empty()) return "works";
  return fmt::format("computes wrong numbers: {}", fmt::join(wrong, "; "));
}

std::vector<std::string> advice_on(const Diagnosis& diagnosis) {
  std::vector<std::string> advice;
  for (const RegisteredDriver& driver : diagnosis.drivers) {
    // Where there is no device the sentence below says it.
    if (driver.error.empty() || diagnosis.devices.empty()) continue;
    advice.push_back(
        fmt::format("The driver of {} cannot be loaded: install it anew, or remove "
                    "that file",
                    driver.file.string()));
  }
  if (diagnosis.devices.empty()) advice.push_back(why_no_devices());
  for (const GraphicsCard& card : diagnosis.cards) {
    if (card.driver.empty() || has_device(diagnosis, card.vendor)) continue;
    advice.push_back(fmt::format("The {} card at {} is not offered by OpenCL: install {}{}",
                                 card.vendor, card.address, card.driver, or_mesa(diagnosis, card)));
  }
  if (!diagnosis.closed_files.empty()) {
    std::vector<std::string> names;
    for (const auto& file : diagnosis.closed_files) names.push_back(file.string());
    advice.push_back(
        fmt::format("You may not open {}: join the groups render and video, and log "
                    "in again",
                    fmt::join(names, ", ")));
  }
  const bool only_unwell = !diagnosis.devices.empty() && !diagnosis.any_works();
  for (const DeviceVerdict& verdict : diagnosis.devices) {
    if (verdict.works || !verdict.device.usable()) continue;
    if (!verdict.trouble.empty()) {
      advice.push_back(fmt::format("Device {} fails: {}", verdict.device.index, verdict.trouble));
      continue;
    }
    advice.push_back(fmt::format("Device {} is not to be trusted: update its driver ({}), {}",
                                 verdict.device.index, verdict.device.driver_version,
                                 only_unwell ? "or install pocl-opencl-icd to run on the CPU"
                                             : "or choose another by --device"));
  }
  if (only_unwell && std::none_of(diagnosis.devices.begin(), diagnosis.devices.end(),
                                  [](const DeviceVerdict& v) { return v.device.usable(); })) {
    advice.emplace_back(
        "No device is usable: install another driver, or pocl-opencl-icd to run on the CPU");
  }
  if (!diagnosis.cache_state.trouble.empty()) {
    advice.push_back(
        fmt::format("Kernels are compiled anew at every start, for their cache {}: "
                    "name a folder by XDG_CACHE_HOME",
                    diagnosis.cache_state.trouble));
  }
  return advice;
}

Diagnosis diagnose(const ContextOpener& open) {
  Diagnosis out;
  // First, so that the loader has opened the drivers: some cannot be opened again after another has
  // closed them.
  const std::vector<DeviceInfo> devices = list_devices();
  out.folder = driver_folder();
  out.drivers = registered_drivers(out.folder.path);
  out.cards = graphics_cards();
  out.closed_files = closed_card_files();
  out.process_limit = memory_limit_remark();
  out.cache = default_cache_directory();
  for (const DeviceInfo& device : devices) out.devices.push_back(examine(device, open));
  out.cache_state = program_cache_state(out.cache);
  out.advice = advice_on(out);
  return out;
}

std::string diagnosis_text(const Diagnosis& diagnosis) {
  std::string out = fmt::format(
      "drivers          {}{}\n", diagnosis.folder.path.string(),
      diagnosis.folder.variable.empty() ? "" : fmt::format(" (by {})", diagnosis.folder.variable));
  for (const RegisteredDriver& driver : diagnosis.drivers) {
    out += fmt::format("  {}: {}, {}\n", driver.file.filename().string(), driver.library,
                       driver.error.empty() ? "loads" : driver.error);
  }
  if (diagnosis.drivers.empty()) out += "  none\n";
  for (const GraphicsCard& card : diagnosis.cards)
    out += fmt::format("card             {} at {}\n", card.vendor, card.address);
  out += fmt::format("memory limit     {}\n", diagnosis.process_limit.empty()
                                                  ? "none for this process"
                                                  : diagnosis.process_limit.substr(kRemark));
  out += fmt::format(
      "kernel cache     {}: {}, {}{}\n",
      diagnosis.cache.empty() ? "none" : diagnosis.cache.string(),
      counted(diagnosis.cache_state.programs, "program"), size_text(diagnosis.cache_state.bytes),
      diagnosis.cache_state.trouble.empty() ? ""
                                            : fmt::format(", {}", diagnosis.cache_state.trouble));
  for (const DeviceVerdict& verdict : diagnosis.devices) {
    const DeviceInfo& device = verdict.device;
    out += fmt::format("device {}         {} ({}), {}, driver {}\n", device.index, device.name,
                       device_type_name(device.type), device.platform, device.driver_version);
    out += fmt::format("  memory         {}, largest buffer {}, local {} KiB\n",
                       size_text(device.global_memory), size_text(device.max_allocation),
                       device.local_memory >> 10);
    if (!verdict.checks.empty()) {
      const auto passed = std::count_if(verdict.checks.begin(), verdict.checks.end(),
                                        [](const SelfTestCheck& check) { return check.passed(); });
      out += fmt::format(
          "  self-test      {} of {} quantities as the double-precision reference has them, "
          "{:.1f} s and {:.1f} s of compiling\n",
          passed, verdict.checks.size(), verdict.seconds, verdict.compile_seconds);
    }
    out += fmt::format("  verdict        {}\n", verdict.text);
  }
  for (const std::string& line : diagnosis.advice)
    out += fmt::format("advice           {}\n", line);
  return out;
}

std::string diagnosis_json(const Diagnosis& diagnosis) {
  using Json = nlohmann::ordered_json;
  Json drivers = Json::array(), cards = Json::array(), closed = Json::array();
  Json devices = Json::array();
  for (const RegisteredDriver& driver : diagnosis.drivers) {
    drivers.push_back(
        {{"file", driver.file.string()}, {"library", driver.library}, {"error", driver.error}});
  }
  for (const GraphicsCard& card : diagnosis.cards)
    cards.push_back({{"address", card.address}, {"vendor", card.vendor}});
  for (const auto& file : diagnosis.closed_files) closed.push_back(file.string());
  for (const DeviceVerdict& verdict : diagnosis.devices) {
    Json checks = Json::array();
    for (const SelfTestCheck& check : verdict.checks) {
      checks.push_back({{"name", check.name},
                        {"error", check.error},
                        {"limit", check.limit},
                        {"passed", check.passed()}});
    }
    devices.push_back({{"device", device_json(verdict.device)},
                       {"works", verdict.works},
                       {"verdict", verdict.text},
                       {"seconds", verdict.seconds},
                       {"compile_seconds", verdict.compile_seconds},
                       {"self_test", checks}});
  }
  const Json out{{"driver_folder", diagnosis.folder.path.string()},
                 {"driver_folder_variable", diagnosis.folder.variable},
                 {"drivers", drivers},
                 {"cards", cards},
                 {"closed_card_files", closed},
                 {"process_limit", diagnosis.process_limit.empty()
                                       ? Json(nullptr)
                                       : Json(diagnosis.process_limit.substr(kRemark))},
                 {"kernel_cache",
                  {{"folder", diagnosis.cache.string()},
                   {"programs", diagnosis.cache_state.programs},
                   {"bytes", diagnosis.cache_state.bytes},
                   {"trouble", diagnosis.cache_state.trouble}}},
                 {"devices", devices},
                 {"works", diagnosis.any_works()},
                 {"advice", diagnosis.advice}};
  return json_text(out, 2) + "\n";
}

}  // namespace raysplats
