// SPDX-License-Identifier: Apache-2.0
// Addition to a float in global memory to which others add at the same time; the last bits of the
// sum depend on their order.
//   FLOAT_ATOMICS 1: one instruction of the device, where its compiler offers one: by
//       cl_ext_float_atomics, which is for OpenCL C 2.0 and later; in PTX by NVIDIA's compiler; by
//       AMD's builtin, which its compiler has for processors with that instruction
//   otherwise: compare-and-swap
#ifndef RS_PRIMITIVES_FLOAT_ADD_H
#define RS_PRIMITIVES_FLOAT_ADD_H

#ifndef FLOAT_ATOMICS
#define FLOAT_ATOMICS 0
#endif

// Where RS_ADD_IN_HARDWARE stays undefined, the sum is swapped in.
#if FLOAT_ATOMICS
#if __OPENCL_C_VERSION__ >= 200 && defined(__opencl_c_ext_fp32_global_atomic_add)
#define RS_ADD_IN_HARDWARE(word, value)                                       \
  atomic_fetch_add_explicit((volatile __global atomic_float*)(word), (value), \
                            memory_order_relaxed, memory_scope_device)
#elif defined(__NV_CL_C_VERSION)
#define RS_ADD_IN_HARDWARE(word, value) \
  __asm__ volatile("red.global.add.f32 [%0], %1;" : : "l"(word), "f"(value) : "memory")
#elif defined(__has_builtin)
#if __has_builtin(__builtin_amdgcn_global_atomic_fadd_f32)
#define RS_ADD_IN_HARDWARE(word, value) __builtin_amdgcn_global_atomic_fadd_f32((word), (value))
#endif
#endif
#endif

void rs_add_float(__global float* word, const float value) {
  if (value == 0.0f) return;
#ifdef RS_ADD_IN_HARDWARE
  RS_ADD_IN_HARDWARE(word, value);
#else
  volatile __global uint* bits = (volatile __global uint*)word;
  // A plain first read would race with the others' writes; 0 is what most first writers find.
  uint old = 0;
  for (;;) {
    const uint seen = atomic_cmpxchg(bits, old, as_uint(as_float(old) + value));
    if (seen == old) break;
    old = seen;
  }
#endif
}

#endif
