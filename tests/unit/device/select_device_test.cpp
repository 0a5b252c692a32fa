// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <unistd.h>

#include <array>
#include <cctype>
#include <cstdio>
#include <memory>
#include <string>

#include "device/context.hpp"
#include "device/driver_trouble.hpp"
#include "device/platform.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "unit/text.hpp"

using namespace raysplats;

namespace {

// Output of this program run on one test case with an environment variable set.
std::string run_self(const std::string& variable, const std::string& test_case) {
  std::array<char, 4096> path{};
  const ssize_t length = ::readlink("/proc/self/exe", path.data(), path.size() - 1);
  REQUIRE(length > 0);
  const std::string command = variable + " '" + path.data() + "' -tc='" + test_case + "' 2>&1";
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(command.c_str(), "r"),
                                                             &::pclose);
  REQUIRE(pipe);
  std::string output;
  for (int c = std::fgetc(pipe.get()); c != EOF; c = std::fgetc(pipe.get()))
    output += static_cast<char>(c);
  return output;
}

}  // namespace

TEST_CASE("select device: the default is usable and described") {
  const DeviceInfo info = select_device("");
  CHECK(info.usable());
  CHECK_FALSE(info.name.empty());
  CHECK(info.compute_units >= 1);
  CHECK(info.max_allocation > 0);
  CHECK(info.max_work_group_size >= 64);
}

TEST_CASE("select device: by index and by part of the name in any case") {
  const std::vector<DeviceInfo> devices = list_devices();
  REQUIRE_FALSE(devices.empty());
  for (const DeviceInfo& info : devices) {
    if (info.usable()) CHECK(select_device(std::to_string(info.index)).name == info.name);
  }
  const DeviceInfo first = select_device("");
  std::string name = first.name.substr(0, first.name.size() / 2 + 1);
  for (char& c : name) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  CHECK(select_device(name).name == first.name);
}

TEST_CASE("select device: selectors that fit nothing") {
  CHECK_THROWS_AS(select_device("9999"), UsageError);
  CHECK_THROWS_AS(select_device("99999999999999999999999999"), UsageError);
  CHECK_THROWS_AS(select_device("-1"), UsageError);
  CHECK_THROWS_AS(select_device("no such device"), UsageError);
}

TEST_CASE("select device: a card by the number in its name") {
  DeviceInfo first;
  first.name = "NVIDIA A100-SXM4-40GB";
  DeviceInfo second = first;
  second.index = 1;
  second.name = "NVIDIA GeForce RTX 4090";
  CHECK(select_among({first, second}, "4090").index == 1);
  CHECK(select_among({first, second}, "100").index == 0);
  CHECK(select_among({first, second}, "1").index == 1);
  // An index that is not there is none of the digits of a name.
  for (const char* selector : {"4", "40", "90"})
    CHECK_THROWS_AS(select_among({first, second}, selector), UsageError);
  CHECK_THROWS_WITH_AS(select_among({first}, "1"),
                       "--device 1: there is 1 device, counted from 0; 'raysplats devices' lists "
                       "them",
                       UsageError);
  CHECK_THROWS_WITH_AS(select_among({first, second}, "3080"),
                       "--device 3080: there are 2 devices, counted from 0, and none has that in "
                       "its name; 'raysplats devices' lists them",
                       UsageError);
  first.problems = {"it is big-endian"};
  CHECK_THROWS_AS(select_among({first, second}, "100"), DeviceError);
}

TEST_CASE("select device: without any platform the message says what to install") {
  const std::string output =
      run_self("OCL_ICD_VENDORS=/nonexistent OPENCL_VENDOR_PATH=/nonexistent",
               "select device: the default*");
  CHECK(output.find("No OpenCL platform is registered in /nonexistent") != std::string::npos);
  CHECK(output.find("pocl-opencl-icd") != std::string::npos);
}

TEST_CASE("context: a device that has gone is refused") {
  DeviceInfo info = select_device("");
  info.index = 1000;
  CHECK_THROWS_AS(Context{info}, DeviceError);
  info = select_device("");
  info.name += " of yesterday";
  CHECK_THROWS_AS(Context{info}, DeviceError);
}

TEST_CASE("releases of Mesa that compute wrongly are known") {
  CHECK(known_fault("rusticl", "22.3.6") ==
        "Mesa 22.3.6 computes wrongly, from 25.0 on it does not");
  CHECK(known_fault("rusticl", "25.0.7-2+deb13u1").empty());
  CHECK(known_fault("Clover", "22.3.6").empty());
}

TEST_CASE("where Mesa alone offers no device the variable that it heeds is named") {
  CHECK(test::contains(why_no_devices({"rusticl", "Clover"}), "set RUSTICL_ENABLE to the driver"));
  CHECK_FALSE(test::contains(why_no_devices({"Clover"}), "RUSTICL_ENABLE"));
}
