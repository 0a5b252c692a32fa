// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <new>
#include <string>

#include "raysplats/error.hpp"

namespace raysplats {

/// Does `work` and returns what the device or a lack of memory made of it, in the sentence of the
/// error; nothing where it ended well. Errors of other kinds are thrown on.
template <class Work>
std::string failure_of(const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kDevice && error.code() != ErrorCode::kMemory) throw;
    return error.what();
  } catch (const std::bad_alloc&) {
    return "The host has no memory left";
  }
  return {};
}

}  // namespace raysplats
