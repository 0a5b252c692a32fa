// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <new>
#include <string>

#include "raysplats/error.hpp"

namespace raysplats {

/// What the device or a lack of memory made of something.
struct KeptFailure {
  std::string reason;  ///< the sentence of the error; "" where it ended well
  bool of_memory = false;
};

/// Does `work` and returns how it failed. Errors of other kinds are thrown on.
template <class Work>
KeptFailure failure_of(const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kDevice && error.code() != ErrorCode::kMemory) throw;
    return {error.what(), error.code() == ErrorCode::kMemory};
  } catch (const std::bad_alloc&) {
    return {"The host has no memory left", true};
  }
  return {};
}

}  // namespace raysplats
