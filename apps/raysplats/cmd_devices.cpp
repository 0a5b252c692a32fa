// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "device/device_json.hpp"
#include "device/program_cache.hpp"
#include "device/tuning.hpp"
#include "raysplats/error.hpp"
#include "util/json_text.hpp"
#include "value_text.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  bool json = false;
  bool clear_cache = false;
};

void print(const DeviceInfo& device) {
  const auto yes = [](bool value) { return value ? "yes" : "no"; };
  fmt::print("[{}] {} ({})\n", device.index, device.name, device_type_name(device.type));
  fmt::print("    platform        {}, {}\n", device.platform, device.platform_version);
  fmt::print("    version         {}, {}, driver {}\n", device.version, device.language_version,
             device.driver_version);
  fmt::print("    compute units   {}, float vectors of {}, work-groups up to {}\n",
             device.compute_units, device.float_vector_width, device.max_work_group_size);
  fmt::print("    memory          {}, largest buffer {}, local {}\n",
             readable_bytes(device.global_memory), readable_bytes(device.max_allocation),
             readable_bytes(device.local_memory));
  fmt::print("    fp64            {}\n", yes(device.has_fp64));
  fmt::print("    float atomics   {}\n", yes(device.has_float_atomics));
  fmt::print("    int64 atomics   {}\n", yes(device.has_int64_atomics));
  fmt::print("    subgroups       {}\n", yes(device.has_subgroups));
  fmt::print("    tuning          {}\n", device.tuning ? describe(*device.tuning) : "none");
  if (device.usable()) {
    fmt::print("    usable          yes\n");
  } else {
    fmt::print("    usable          no: {}\n", fmt::join(device.problems, ", "));
  }
}

void run(const Options& options) {
  if (options.clear_cache) {
    if (options.json) throw UsageError("--clear-cache lists no devices: leave out --json");
    const std::filesystem::path directory = default_cache_directory();
    fmt::print("{} compiled programs removed from {}\n", clear_program_cache(directory),
               directory.string());
    return;
  }
  std::vector<DeviceInfo> devices = list_devices();
  const TuningStore store;
  for (DeviceInfo& device : devices) device.tuning = store.find(device);
  if (options.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const DeviceInfo& device : devices) list.push_back(device_json(device));
    fmt::print("{}\n", json_text(nlohmann::ordered_json{{"devices", list}}, 2));
  } else {
    for (const DeviceInfo& device : devices) print(device);
  }
  // Says what to install when there is no platform, and why when no device of any platform can be
  // used.
  const DeviceInfo chosen = select_device("");
  if (!options.json) fmt::print("Without --device: [{}] {}\n", chosen.index, chosen.name);
}

}  // namespace

Command add_devices_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("devices", "List every OpenCL platform and device");
  auto options = std::make_shared<Options>();
  command->add_flag("--json", options->json, "Print JSON");
  command->add_flag("--clear-cache", options->clear_cache,
                    "Remove the compiled kernels of earlier runs instead");
  return {command, [options] { run(*options); }};
}

}  // namespace raysplats::cli
