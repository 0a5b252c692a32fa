// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <memory>

#include "bench/doctor.hpp"
#include "commands.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"

namespace raysplats::cli {
namespace {

void run(bool json) {
  const Diagnosis diagnosis =
      diagnose([](const DeviceInfo& device) { return open_context(DeviceFlags{}, device); });
  fmt::print("{}", json ? diagnosis_json(diagnosis) : diagnosis_text(diagnosis));
  if (!diagnosis.any_works())
    throw DeviceError(diagnosis.devices.empty()
                          ? why_no_devices()
                          : "No OpenCL device works: the verdicts above say why for each");
}

}  // namespace

Command add_doctor_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "doctor", "Say whether this computer can run the program, and what to install");
  auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "Print JSON");
  return {command, [json] { run(*json); }};
}

}  // namespace raysplats::cli
