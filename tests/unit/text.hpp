// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include "raysplats/error.hpp"

namespace raysplats::test {

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// The message of the DataError that `action` throws; "" when it throws none.
inline std::string data_error(const std::function<void()>& action) {
  try {
    action();
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

}  // namespace raysplats::test
