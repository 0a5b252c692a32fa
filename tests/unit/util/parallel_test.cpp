// SPDX-License-Identifier: Apache-2.0
#include "util/parallel.hpp"

#include <doctest/doctest.h>

#include <atomic>
#include <stdexcept>
#include <string>
#include <vector>

using namespace raysplats;

TEST_CASE("in parallel: every number is worked on once") {
  for (const std::size_t count : {0u, 1u, 1000u}) {
    std::vector<std::atomic<int>> calls(count);
    in_parallel(count, [&](std::size_t i) { ++calls[i]; });
    for (const std::atomic<int>& call : calls) CHECK(call == 1);
  }
}

TEST_CASE("in parallel: what is thrown is that of the least number") {
  for (int repeat = 0; repeat < 20; ++repeat) {
    std::string message;
    try {
      in_parallel(100, [](std::size_t i) {
        if (i >= 7) throw std::runtime_error(std::to_string(i));
      });
    } catch (const std::runtime_error& error) {
      message = error.what();
    }
    CHECK(message == "7");
  }
}
