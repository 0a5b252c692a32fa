// SPDX-License-Identifier: Apache-2.0
// The dialect in which cl/shared is written: the same headers compile as OpenCL C 1.2 and as C++.
#ifndef RS_SHARED_COMPAT_H
#define RS_SHARED_COMPAT_H

#ifdef __OPENCL_C_VERSION__
typedef float rs_float;
typedef int rs_int;
typedef uint rs_uint;
#define RS_STATIC_ASSERT_SIZE(type, bytes) \
  typedef char rs_size_of_##type[(sizeof(type) == (bytes)) ? 1 : -1]
#else
#include <cstddef>
#include <cstdint>
typedef float rs_float;
typedef std::int32_t rs_int;
typedef std::uint32_t rs_uint;
#define RS_STATIC_ASSERT_SIZE(type, bytes) \
  static_assert(sizeof(type) == (bytes), #type " has another size")
#endif

#endif
