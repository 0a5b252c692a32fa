// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

/// Ends a test case, and prints the reason (a string literal), where `condition` does not hold:
/// what is missing here, such as a program or a data set. Without a word it would count as passed.
#define SKIP_TEST_UNLESS(condition, reason) \
  do {                                      \
    if (!(condition)) {                     \
      MESSAGE("SKIPPED: " reason);          \
      return;                               \
    }                                       \
  } while (false)
