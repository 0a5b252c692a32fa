// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <optional>
#include <thread>

#include "device/program_cache.hpp"
#include "unit/temporary_directory.hpp"

using namespace raysplats;

TEST_CASE("programs of two keys are compiled at once, those of one key one after the other") {
  const TemporaryDirectory folder;
  std::optional<ProgramCache::BuildLock> first(std::in_place, folder.path(), "one");
  const ProgramCache::BuildLock other(folder.path(), "another");
  std::atomic<bool> released = false;
  bool waited = false;
  std::thread second([&] {
    const ProgramCache::BuildLock same(folder.path(), "one");
    waited = released;
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  released = true;
  first.reset();
  second.join();
  CHECK(waited);
}

TEST_CASE("without a directory nothing is locked, and no file made") {
  const ProgramCache::BuildLock first({}, "one"), second({}, "one");
  CHECK(!std::filesystem::exists(".lock"));
}
