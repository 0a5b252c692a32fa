// SPDX-License-Identifier: Apache-2.0
#include "device/tuning.hpp"

#include <doctest/doctest.h>

#include <string>

#include "device/context.hpp"
#include "device/device_json.hpp"
#include "raysplats/error.hpp"
#include "unit/fixture.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;

namespace {

DeviceInfo device(const std::string& name, const std::string& driver = "1.0") {
  DeviceInfo out;
  out.name = name;
  out.platform = "Platform";
  out.driver_version = driver;
  return out;
}

const DeviceTuning kTuning{false, 8, 16, 64, 32, true};

}  // namespace

TEST_CASE("tuning: stored per device, driver and version, and found again") {
  const TemporaryDirectory folder;
  const std::string directory = (folder.path() / "cache").string();
  CHECK_FALSE(TuningStore(directory).find(device("A")));

  TuningStore store(directory);
  store.store(device("A"), kTuning);
  store.store(device("B"), {true, 32, 32, 48, 0});
  store.store(device("S"), {true, 16, 32, 48, 0, false, true});
  CHECK(store.path() == folder.path() / "cache" / "tuning.json");
  CHECK(TuningStore(directory).find(device("A")) == kTuning);
  CHECK(TuningStore(directory).find(device("B")) == DeviceTuning{true, 32, 32, 48, 0});
  CHECK(TuningStore(directory).find(device("S")) == DeviceTuning{true, 16, 32, 48, 0, false, true});
  CHECK_FALSE(TuningStore(directory).find(device("A", "2.0")));
  CHECK_FALSE(TuningStore(directory).find(device("C")));
  DeviceInfo elsewhere = device("A");
  elsewhere.platform = "Other";
  CHECK_FALSE(TuningStore(directory).find(elsewhere));

  TuningStore(directory).store(device("A"), {false, 16, 64, 96, 0});
  CHECK(TuningStore(directory).find(device("A")) == DeviceTuning{false, 16, 64, 96, 0});

  // An entry of another version of the program is left alone and not used.
  std::string text = read_bytes(store.path());
  const std::string version = std::string("\"raysplats\": \"");
  for (std::size_t at = text.find(version); at != std::string::npos;
       at = text.find(version, at + 1)) {
    text.insert(at + version.size(), 1, '9');
  }
  folder.write("cache/tuning.json", text);
  CHECK_FALSE(TuningStore(directory).find(device("A")));
  TuningStore(directory).store(device("A"), kTuning);
  CHECK(TuningStore(directory).find(device("A")) == kTuning);
  CHECK(TuningStore(directory).remove(device("A")) == 2);
  CHECK_FALSE(TuningStore(directory).find(device("A")));
  CHECK(TuningStore(directory).remove(device("A")) == 0);
  CHECK(TuningStore(directory).remove(device("B")) == 1);
}

TEST_CASE("tuning: a device whose name is no text is found again, and its JSON can be written") {
  const TemporaryDirectory folder;
  DeviceInfo odd = device("card \xae");
  odd.driver_version = "\xff 1";
  TuningStore(folder.path().string()).store(odd, kTuning);
  odd.tuning = TuningStore(folder.path().string()).find(odd);
  REQUIRE(odd.tuning == kTuning);
  CHECK(device_json(odd).at("tuning").at("bvh") == true);
}

TEST_CASE("tuning: a broken file is ignored with one line, and replaced") {
  const TemporaryDirectory folder;
  const std::string directory = folder.path().string();
  TuningStore(directory).store(device("A"), kTuning);
  const std::string good = read_bytes(folder.path() / "tuning.json");
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    const std::size_t at = text.find(from);
    REQUIRE(at != std::string::npos);
    return text.replace(at, from.size(), to);
  };
  for (const std::string& text :
       {std::string(), std::string("{"), std::string("[]"), std::string("null"),
        good.substr(0, good.size() / 2), replaced("raysplats-tuning", "other"),
        replaced("\"schema_version\": 1", "\"schema_version\": 2"),
        replaced("\"packet_width\": 8", "\"packet_width\": 3"),
        replaced("\"packet_width\": 8", "\"packet_width\": \"8\""),
        replaced("\"tile\": 16", "\"tile\": 17"), replaced("\"pending\": 64", "\"pending\": 0"),
        replaced("\"group\": 32", "\"group\": -1"), replaced("\"driver\"", "\"drver\"")}) {
    INFO(text);
    folder.write("tuning.json", text);
    const LogCapture log;
    CHECK_FALSE(TuningStore(directory).find(device("A")));
    CHECK(log.lines() == 1);
    CHECK(log.contains("tuning.json"));
  }
  {
    const LogCapture log;
    TuningStore(directory).store(device("A"), kTuning);
  }
  const LogCapture log;
  CHECK(TuningStore(directory).find(device("A")) == kTuning);
  CHECK(log.lines() == 0);
}

TEST_CASE("tuning: a directory that cannot be made is a DataError") {
  const TemporaryDirectory folder;
  folder.write("file", "");
  TuningStore store((folder.path() / "file" / "below").string());
  CHECK_THROWS_AS(store.store(device("A"), kTuning), DataError);
}

TEST_CASE("tuning: a context has that of its device unless told otherwise") {
  const TemporaryDirectory folder;
  const DeviceInfo chosen = test_device();
  CHECK_FALSE(chosen.tuning);
  ContextOptions options;
  options.cache_directory = folder.path().string();
  CHECK_FALSE(Context(chosen, options).device().tuning);
  TuningStore(options.cache_directory).store(chosen, kTuning);
  Context context(chosen, options);
  CHECK(context.device().tuning == kTuning);
  context.set_tuning(std::nullopt);
  CHECK_FALSE(context.device().tuning);
  options.tuning = false;
  CHECK_FALSE(Context(chosen, options).device().tuning);
}

TEST_CASE("launches are kept on request, with their programs") {
  ContextOptions options;
  options.profile = options.keep_launches = true;
  Context context(test_device(), options);
  Buffer<std::uint32_t> a(context, 256, "a"), b(context, 256, "b");
  CHECK(context.take_launches().empty());
  context.kernel("parallel/layout_probe.cl", "layout_probe").launch(Range{}, a);
  b.clear();
  b.copy_from(a, 256);
  const std::vector<LaunchTime> launches = context.take_launches();
  REQUIRE(launches.size() == 3);
  CHECK(launches[0].program == "parallel/layout_probe.cl");
  CHECK(launches[0].kernel == "layout_probe");
  CHECK(launches[0].seconds > 0);
  CHECK(launches[1].program.empty());
  CHECK(launches[1].kernel == "(fill)");
  CHECK(launches[2].kernel == "(copy)");
  CHECK(context.take_launches().empty());
}
