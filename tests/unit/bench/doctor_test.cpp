// SPDX-License-Identifier: Apache-2.0
#include "bench/doctor.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "raysplats/error.hpp"
#include "unit/temporary_directory.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using test::contains;

namespace {

DeviceVerdict sound_device(DeviceType type, const std::string& vendor) {
  DeviceVerdict verdict;
  verdict.device.type = type;
  verdict.device.vendor = vendor;
  verdict.works = true;
  return verdict;
}

}  // namespace

TEST_CASE("every device of this computer works, and the diagnosis says by what") {
  const Diagnosis diagnosis =
      diagnose([](const DeviceInfo& device) { return std::make_unique<Context>(device); });
  REQUIRE(!diagnosis.devices.empty());
  CHECK(diagnosis.any_works());
  CHECK(diagnosis.devices[0].checks.size() == 14);
  CHECK(diagnosis.devices[0].text == "works");
  CHECK(contains(diagnosis_text(diagnosis), "14 of 14 quantities"));
  const nlohmann::json json = nlohmann::json::parse(diagnosis_json(diagnosis));
  CHECK(json.at("works") == true);
  CHECK(json.at("devices").at(0).at("self_test").size() == 14);
  CHECK(json.at("drivers").size() == diagnosis.drivers.size());
}

TEST_CASE("a device that cannot be opened is a verdict, not an end") {
  const Diagnosis diagnosis = diagnose([](const DeviceInfo&) -> std::unique_ptr<Context> {
    throw DeviceError("the compiler fell over");
  });
  REQUIRE(!diagnosis.devices.empty());
  CHECK(!diagnosis.any_works());
  CHECK(diagnosis.devices[0].text == "fails: the compiler fell over");
  CHECK(contains(diagnosis_text(diagnosis), "advice           Device 0 is not to be trusted"));
  CHECK(contains(diagnosis.advice.back(), "pocl-opencl-icd"));
}

TEST_CASE("what drivers say in no known characters does not keep a diagnosis from being written") {
  Diagnosis diagnosis;
  diagnosis.devices.push_back({});
  diagnosis.devices[0].device.name = "card \xae";
  const nlohmann::json json = nlohmann::json::parse(diagnosis_json(diagnosis));
  CHECK(json.at("devices").at(0).at("device").at("name") == "card \ufffd");
}

TEST_CASE("a driver that fails by its surroundings is not to be updated") {
  Diagnosis diagnosis;
  diagnosis.devices = {sound_device(DeviceType::kCpu, "Intel")};
  diagnosis.devices[0].works = false;
  diagnosis.devices[0].trouble = "the folder of its cache cannot be written";
  const std::vector<std::string> advice = advice_on(diagnosis);
  REQUIRE(advice.size() == 1);
  CHECK(advice[0] == "Device 0 fails: the folder of its cache cannot be written");
}

TEST_CASE("wrong numbers and what is no number are named with error and limit") {
  std::vector<SelfTestCheck> checks{{"tiles: image", 1e-6, 1e-4}, {"tree: means", 5e-3, 2e-3}};
  CHECK(verdict_on({checks[0]}) == "works");
  CHECK(verdict_on(checks) == "computes wrong numbers: tree: means 5.0e-03 of 2e-03");
  checks[0].error = std::numeric_limits<double>::quiet_NaN();
  CHECK(contains(verdict_on({checks[0]}), "tiles: image nan of 1e-04"));
}

TEST_CASE("cards on the bus are found by class and named by vendor") {
  const TemporaryDirectory bus;
  const auto device = [&](const std::string& address, const char* kind, const char* vendor) {
    bus.write(address + "/class", std::string(kind) + "\n");
    bus.write(address + "/vendor", std::string(vendor) + "\n");
  };
  device("0000:02:00.0", "0x030200", "0x10de");
  device("0000:01:00.0", "0x038000", "0x1002");
  device("0000:00:02.0", "0x030000", "0x8086");
  device("0000:00:03.0", "0x030000", "0x1af4");
  device("0000:00:04.0", "0x020000", "0x10de");  // a network card
  const std::vector<GraphicsCard> cards = graphics_cards(bus.path());
  REQUIRE(cards.size() == 4);
  CHECK(cards[0].vendor == "Intel");
  CHECK(cards[1].vendor == "0x1af4");
  CHECK(cards[1].driver.empty());
  CHECK(cards[2].vendor == "AMD");
  CHECK(cards[3].address == "0000:02:00.0");
  CHECK(graphics_cards(bus.path() / "none").empty());

  Diagnosis diagnosis;
  diagnosis.cards = cards;
  diagnosis.devices = {sound_device(DeviceType::kCpu, "Intel"),
                       sound_device(DeviceType::kGpu, "NVIDIA Corporation")};
  // A processor of a vendor is no card of it.
  const std::vector<std::string> advice = advice_on(diagnosis);
  REQUIRE(advice.size() == 2);
  CHECK(contains(advice[0], "intel-opencl-icd"));
  CHECK(contains(advice[1], "rocm-opencl-runtime"));

  // Mesa's OpenCL keeps quiet about cards until it is told to use them.
  diagnosis.drivers = {{"/etc/OpenCL/vendors/rusticl.icd", "libRusticlOpenCL.so.1", ""}};
  CHECK(contains(advice_on(diagnosis)[1],
                 "rocm-opencl-runtime of AMD's repository), or set "
                 "RUSTICL_ENABLE=radeonsi"));
  diagnosis.drivers[0].error = "no such file";
  CHECK_FALSE(contains(advice_on(diagnosis).back(), "RUSTICL_ENABLE"));
}

TEST_CASE("files of cards, drivers that do not load and a locked cache have their advice") {
  Diagnosis diagnosis;
  diagnosis.devices = {sound_device(DeviceType::kCpu, "Intel")};
  CHECK(advice_on(diagnosis).empty());
  diagnosis.closed_files = {"/dev/dri/renderD128"};
  diagnosis.drivers = {{"/etc/OpenCL/vendors/a.icd", "liba.so", "no such file"}};
  diagnosis.cache_state.trouble = "it cannot be written (Permission denied)";
  const std::vector<std::string> advice = advice_on(diagnosis);
  REQUIRE(advice.size() == 3);
  CHECK(contains(advice[0], "a.icd"));
  CHECK(contains(advice[1], "/dev/dri/renderD128"));
  CHECK(contains(advice[1], "groups render and video"));
  CHECK(contains(advice[2], "XDG_CACHE_HOME"));
}

TEST_CASE("the state of the folder of compiled programs") {
  const TemporaryDirectory folder;
  folder.write("a.bin", "12345");
  folder.write("notes.txt", "mine");
  const ProgramCacheState state = program_cache_state(folder.path());
  CHECK(state.programs == 1);
  CHECK(state.bytes == 5);
  CHECK(state.trouble.empty());
  CHECK(contains(program_cache_state("/proc/none").trouble, "cannot be written"));
  CHECK(contains(program_cache_state({}).trouble, "XDG_CACHE_HOME"));
}
