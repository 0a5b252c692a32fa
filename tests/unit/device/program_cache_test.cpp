// SPDX-License-Identifier: Apache-2.0
#include "device/program_cache.hpp"

#include <doctest/doctest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

using Bytes = std::vector<unsigned char>;

Bytes pattern(std::size_t size, unsigned seed) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<unsigned char>(i * 31 + seed);
  return bytes;
}

// Files of programs.
std::vector<fs::path> programs_in(const fs::path& folder) {
  std::vector<fs::path> out;
  for (const fs::path& path : entries(folder)) {
    if (path.filename() != ".lock") out.push_back(path);
  }
  return out;
}

// PoCL is not asked for binaries while it keeps kernels itself.
class AskedForBinaries {
  ScopedVariable pocl_{"POCL_KERNEL_CACHE", "0"};
};

// Runs a kernel that needs no arguments but a buffer in a context with this cache; the words it
// wrote.
std::uint32_t probe(const fs::path& cache,
                    const std::function<void(std::size_t, const std::string&)>& compiling = {}) {
  ContextOptions options;
  options.cache_directory = cache.string();
  options.compiling = compiling;
  Context context(test_device(), options);
  Buffer<std::uint32_t> layout(context, 256, "layout");
  context.kernel("parallel/layout_probe.cl", "layout_probe").launch(Range{}, layout);
  return layout.read(0);
}

}  // namespace

TEST_CASE("program cache: what is stored is loaded") {
  const TemporaryDirectory folder;
  const ProgramCache cache((folder.path() / "a" / "b").string());
  CHECK_FALSE(cache.load("key").has_value());
  cache.store("key", pattern(1000, 1));
  CHECK(cache.load("key") == pattern(1000, 1));
  cache.store("key", pattern(10, 2));
  CHECK(cache.load("key") == pattern(10, 2));
  CHECK_FALSE(cache.load("other").has_value());
  CHECK(programs_in(cache.directory()).size() == 1);
  cache.remove("key");
  CHECK_FALSE(cache.load("key").has_value());
}

TEST_CASE("program cache: damaged entries are not loaded") {
  const TemporaryDirectory folder;
  const ProgramCache cache(folder.path().string());
  cache.store("key", pattern(1000, 1));
  const fs::path file = programs_in(folder.path()).at(0);
  const std::string good = read_bytes(file);
  for (const std::size_t size : {0u, 5u, 23u, 24u, 500u}) {
    folder.write(file.filename().string(), good.substr(0, size));
    CHECK_FALSE(cache.load("key").has_value());
  }
  for (const std::size_t position : {0u, 9u, 17u, 30u, 1000u}) {
    std::string bad = good;
    bad[position] = static_cast<char>(bad[position] ^ 4);
    folder.write(file.filename().string(), bad);
    CHECK_FALSE(cache.load("key").has_value());
  }
  folder.write(file.filename().string(), good + "x");
  CHECK_FALSE(cache.load("key").has_value());
  folder.write(file.filename().string(), good);
  CHECK(cache.load("key").has_value());
}

TEST_CASE("program cache: a folder that cannot be used turns it off") {
  const TemporaryDirectory folder;
  folder.write("file", "text");
  const ProgramCache cache((folder.path() / "file" / "below").string());
  CHECK(cache.directory().empty());
  cache.store("key", pattern(10, 1));
  CHECK_FALSE(cache.load("key").has_value());
  CHECK(probe(folder.path() / "file" / "below") > 1);
}

TEST_CASE("program cache: the key depends on source, options, device and driver") {
  DeviceInfo device;
  device.name = "a";
  const std::string key = ProgramCache::key("source", "options", device);
  CHECK(key == ProgramCache::key("source", "options", device));
  CHECK(key != ProgramCache::key("source2", "options", device));
  CHECK(key != ProgramCache::key("source", "options2", device));
  DeviceInfo other = device;
  other.driver_version = "2";
  CHECK(key != ProgramCache::key("source", "options", other));
  other = device;
  other.name = "b";
  CHECK(key != ProgramCache::key("source", "options", other));
}

TEST_CASE("program cache: a context fills it, uses it and repairs it") {
  const AskedForBinaries asked;
  // Where programs from binaries cannot tell their arguments, checking them passes the cache by.
  const ScopedVariable unchecked("RAYSPLATS_CHECK_ARGUMENTS", "0");
  const TemporaryDirectory folder;
  const std::uint32_t expected = probe(folder.path());
  CHECK(expected > 1);
  REQUIRE(programs_in(folder.path()).size() == 1);
  const fs::path file = programs_in(folder.path())[0];
  const std::string good = read_bytes(file);
  const auto written = fs::last_write_time(file);
  CHECK(probe(folder.path()) == expected);
  CHECK(fs::last_write_time(file) == written);  // a hit writes nothing

  for (const std::string& bad :
       {good.substr(0, good.size() / 2), good.substr(0, 100) + std::string(good.size() - 100, 'x'),
        std::string()}) {
    folder.write(file.filename().string(), bad);
    CHECK(probe(folder.path()) == expected);
    CHECK(read_bytes(file).size() > 100);
    CHECK(read_bytes(file) != bad);
  }
}

TEST_CASE("program cache: a driver that keeps kernels itself is not asked for binaries") {
  const TemporaryDirectory folder;
  const ScopedVariable keeps("POCL_KERNEL_CACHE", "1");
  const ScopedVariable plain("RAYSPLATS_CHECK_ARGUMENTS", "0");
  const bool pocl = test_device().platform.find("Portable Computing Language") != std::string::npos;
  std::size_t compiled = 0;
  const auto count = [&](std::size_t number, const std::string&) { compiled = number; };
  CHECK(probe(folder.path(), count) > 1);
  CHECK(compiled == 1);
  REQUIRE(programs_in(folder.path()).size() == 1);
  const ProgramCache cache(folder.path().string());
  const std::string key = programs_in(folder.path())[0].stem().string();
  CHECK(cache.load(key)->empty() == pocl);
  compiled = 0;
  CHECK(probe(folder.path(), count) > 1);
  CHECK(compiled == 0);  // nobody hears of what the driver had
  {
    const AskedForBinaries asked;
    CHECK(probe(folder.path(), count) > 1);
    CHECK_FALSE(cache.load(key)->empty());
  }
}

TEST_CASE("program cache: a sound entry with a binary the driver refuses is replaced") {
  const AskedForBinaries asked;
  const TemporaryDirectory folder;
  const std::uint32_t expected = probe(folder.path());
  const fs::path file = programs_in(folder.path()).at(0);
  const ProgramCache cache(folder.path().string());
  cache.store(file.stem().string(), pattern(5000, 3));
  CHECK(probe(folder.path()) == expected);
  CHECK(cache.load(file.stem().string()) != pattern(5000, 3));
}

TEST_CASE("program cache: threads with a context each share a folder") {
  const TemporaryDirectory folder;
  std::atomic<int> good{0};
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] { good += probe(folder.path()) > 1; });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(good == 4);
  CHECK(programs_in(folder.path()).size() == 1);  // no temporary file is left
}

TEST_CASE("program cache: processes that store and load the same key never see half an entry") {
  const TemporaryDirectory folder;
  const ProgramCache cache(folder.path().string());
  std::vector<pid_t> children;
  for (unsigned child = 0; child < 4; ++child) {
    const pid_t pid = ::fork();
    REQUIRE(pid >= 0);
    if (pid == 0) {
      bool sound = true;
      for (int i = 0; i < 100; ++i) {
        cache.store("key", pattern(20000 + child, child));
        // Another process may have replaced it, but never by less than a whole entry.
        const auto loaded = cache.load("key");
        sound = sound && loaded &&
                *loaded == pattern(loaded->size(), static_cast<unsigned>(loaded->size() - 20000));
      }
      ::_exit(sound ? 0 : 1);
    }
    children.push_back(pid);
  }
  for (const pid_t pid : children) {
    int status = 0;
    ::waitpid(pid, &status, 0);
    CHECK(WIFEXITED(status));
    CHECK(WEXITSTATUS(status) == 0);
  }
  CHECK(programs_in(folder.path()).size() == 1);
}
