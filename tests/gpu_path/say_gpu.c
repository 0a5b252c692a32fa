// SPDX-License-Identifier: Apache-2.0
// Library to preload: every OpenCL device says that it is a GPU, so that the host takes the form of
// its kernels and launches that GPUs get, on whatever implementation is at hand.
#define _GNU_SOURCE
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

typedef cl_int (*GetDeviceInfo)(cl_device_id, cl_device_info, size_t, void*, size_t*);
typedef cl_int (*GetDeviceIds)(cl_platform_id, cl_device_type, cl_uint, cl_device_id*, cl_uint*);

static void* next(const char* name) {
  void* found = dlsym(RTLD_NEXT, name);
  if (found == NULL) {
    fprintf(stderr, "say_gpu: no %s behind this library\n", name);
    abort();
  }
  return found;
}

cl_int clGetDeviceInfo(
    cl_device_id device, cl_device_info name, size_t size, void* value, size_t* size_out) {
  const cl_int status =
      ((GetDeviceInfo)next("clGetDeviceInfo"))(device, name, size, value, size_out);
  if (status == CL_SUCCESS && name == CL_DEVICE_TYPE && value != NULL)
    *(cl_device_type*)value = CL_DEVICE_TYPE_GPU;
  return status;
}

// Who asks for GPUs gets every device, who asks for another type gets none.
cl_int clGetDeviceIDs(cl_platform_id platform,
                      cl_device_type type,
                      cl_uint room,
                      cl_device_id* devices,
                      cl_uint* count) {
  if ((type & (CL_DEVICE_TYPE_GPU | CL_DEVICE_TYPE_DEFAULT)) == 0) {
    if (count != NULL) *count = 0;
    return CL_DEVICE_NOT_FOUND;
  }
  return ((GetDeviceIds)next("clGetDeviceIDs"))(platform, CL_DEVICE_TYPE_ALL, room, devices, count);
}
