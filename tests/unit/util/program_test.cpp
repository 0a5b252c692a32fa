// SPDX-License-Identifier: Apache-2.0
#include "util/program.hpp"

#include <doctest/doctest.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <thread>

#include "unit/temporary_directory.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

/// Starts a shell and lets go of it without finish() as soon as it is where it says so.
void begin_and_leave(const std::string& body) {
  const TemporaryDirectory folder;
  const fs::path begun = folder / "begun";
  const ProgramInput program("/bin/sh", {"-c", body, begun.string()});
  while (!fs::exists(begun)) std::this_thread::sleep_for(std::chrono::milliseconds(5));
}

}  // namespace

// They end or hang, which is for the limit on a test's time to tell.
TEST_CASE("a program that is left ends, also where it heeds no signal and waits for more") {
  begin_and_leave(": > \"$0\"; cat");
  begin_and_leave("trap : TERM; : > \"$0\"; cat");
  begin_and_leave("trap '' TERM; : > \"$0\"; while :; do sleep 1; done");
}
