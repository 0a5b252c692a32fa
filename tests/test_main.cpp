// SPDX-License-Identifier: Apache-2.0
#define DOCTEST_CONFIG_IMPLEMENT
#include <doctest/doctest.h>
#include <stdlib.h>

int main(int argc, char** argv) {
  // Every launch of a test compares its arguments with what the kernel declares.
  ::setenv("RAYSPLATS_CHECK_ARGUMENTS", "1", 0);
  doctest::Context context(argc, argv);
  return context.run();
}
