// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "device/cl.hpp"
#include "raysplats/error.hpp"

namespace raysplats {

std::string cl_error_name(cl_int status) {
#define RS_NAME(code) \
  case code:          \
    return #code
  switch (status) {
    RS_NAME(CL_SUCCESS);
    RS_NAME(CL_DEVICE_NOT_FOUND);
    RS_NAME(CL_DEVICE_NOT_AVAILABLE);
    RS_NAME(CL_COMPILER_NOT_AVAILABLE);
    RS_NAME(CL_MEM_OBJECT_ALLOCATION_FAILURE);
    RS_NAME(CL_OUT_OF_RESOURCES);
    RS_NAME(CL_OUT_OF_HOST_MEMORY);
    RS_NAME(CL_PROFILING_INFO_NOT_AVAILABLE);
    RS_NAME(CL_BUILD_PROGRAM_FAILURE);
    RS_NAME(CL_MISALIGNED_SUB_BUFFER_OFFSET);
    RS_NAME(CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST);
    RS_NAME(CL_INVALID_VALUE);
    RS_NAME(CL_INVALID_PLATFORM);
    RS_NAME(CL_INVALID_DEVICE);
    RS_NAME(CL_INVALID_CONTEXT);
    RS_NAME(CL_INVALID_COMMAND_QUEUE);
    RS_NAME(CL_INVALID_MEM_OBJECT);
    RS_NAME(CL_INVALID_BINARY);
    RS_NAME(CL_INVALID_BUILD_OPTIONS);
    RS_NAME(CL_INVALID_PROGRAM);
    RS_NAME(CL_INVALID_PROGRAM_EXECUTABLE);
    RS_NAME(CL_INVALID_KERNEL_NAME);
    RS_NAME(CL_INVALID_KERNEL);
    RS_NAME(CL_INVALID_ARG_INDEX);
    RS_NAME(CL_INVALID_ARG_VALUE);
    RS_NAME(CL_INVALID_ARG_SIZE);
    RS_NAME(CL_INVALID_KERNEL_ARGS);
    RS_NAME(CL_INVALID_WORK_DIMENSION);
    RS_NAME(CL_INVALID_WORK_GROUP_SIZE);
    RS_NAME(CL_INVALID_WORK_ITEM_SIZE);
    RS_NAME(CL_INVALID_GLOBAL_OFFSET);
    RS_NAME(CL_INVALID_EVENT_WAIT_LIST);
    RS_NAME(CL_INVALID_OPERATION);
    RS_NAME(CL_INVALID_BUFFER_SIZE);
    RS_NAME(CL_INVALID_GLOBAL_WORK_SIZE);
    default:
      return fmt::format("OpenCL status {}", status);
  }
#undef RS_NAME
}

void throw_cl_error(const cl::Error& error, const std::string& what) {
  const cl_int status = error.err();
  const std::string message =
      fmt::format("{}: {} reported {}", what, error.what(), cl_error_name(status));
  if (status == CL_MEM_OBJECT_ALLOCATION_FAILURE || status == CL_OUT_OF_HOST_MEMORY ||
      status == CL_INVALID_BUFFER_SIZE) {
    throw ResourceError(message + "; " + kLessMemory);
  }
  throw DeviceError(message);
}

}  // namespace raysplats
