// SPDX-License-Identifier: Apache-2.0
#pragma once

// The only place that includes the OpenCL C++ bindings. Target 300 / minimum 110 is the pair that
// compiles with the bindings of Debian 12 (CLHPP issue 108); calls beyond OpenCL 1.2 are guarded by
// queries.
#define CL_HPP_ENABLE_EXCEPTIONS
#define CL_HPP_TARGET_OPENCL_VERSION 300
#define CL_HPP_MINIMUM_OPENCL_VERSION 110
#define CL_TARGET_OPENCL_VERSION 300
#include <CL/opencl.hpp>
#include <string>

namespace raysplats {

/// "CL_OUT_OF_RESOURCES" for -5 and so on.
std::string cl_error_name(cl_int status);

/// What to do where memory does not suffice.
inline constexpr const char* kLessMemory =
    "use fewer Gaussians (--max-gaussians of train and convert), smaller pictures or a device with "
    "more memory";

/// Throws the DeviceError or ResourceError that fits `error`; `what` says what was attempted and on
/// what.
[[noreturn]] void throw_cl_error(const cl::Error& error, const std::string& what);

}  // namespace raysplats
