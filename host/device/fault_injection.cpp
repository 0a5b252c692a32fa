// SPDX-License-Identifier: Apache-2.0
#include "device/fault_injection.hpp"

#include <charconv>
#include <cstdlib>
#include <string_view>

#include "device/cl.hpp"

namespace raysplats {
namespace {

struct Description {
  const char* variable;
  const char* call;
  cl_int status;
};

// What is said of each fault, in the order of Fault.
constexpr std::array<Description, 5> kFaults{{
    {"RAYSPLATS_FAIL_ALLOC", "clCreateBuffer", CL_MEM_OBJECT_ALLOCATION_FAILURE},
    {"RAYSPLATS_FAIL_BUILD", "", CL_SUCCESS},
    {"RAYSPLATS_FAIL_LAUNCH", "clEnqueueNDRangeKernel", CL_OUT_OF_RESOURCES},
    {"RAYSPLATS_FAIL_LISTS", "", CL_SUCCESS},
    {"RAYSPLATS_FAIL_HITS", "", CL_SUCCESS},
}};

}  // namespace

FaultInjection::FaultInjection() {
  for (std::size_t i = 0; i < kFaults.size(); ++i) {
    const char* text = std::getenv(kFaults[i].variable);
    if (text == nullptr) continue;
    const std::string_view digits(text);
    // What is no number makes nothing fail.
    std::from_chars(digits.data(), digits.data() + digits.size(), left_[i]);
  }
}

void FaultInjection::check(Fault fault) {
  const Description& description = kFaults[static_cast<std::size_t>(fault)];
  if (strikes(fault)) throw cl::Error(description.status, description.call);
}

bool FaultInjection::strikes(Fault fault) {
  std::size_t& left = left_[static_cast<std::size_t>(fault)];
  return left > 0 && --left == 0;
}

}  // namespace raysplats
