// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include "raysplats/error.hpp"

namespace raysplats::test {

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// The message of the E that `action` throws; "" when it throws none.
template <class E>
std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const E& error) {
    return error.what();
  }
  return "";
}

inline std::string data_error(const std::function<void()>& action) {
  return message_of<DataError>(action);
}

}  // namespace raysplats::test
