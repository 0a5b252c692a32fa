// SPDX-License-Identifier: Apache-2.0
// Hints that the cache line of a global pointer will be read or written soon; any address is
// allowed. Scattered accesses wait for their lines one after the other otherwise: neither the
// processor nor OpenCL's prefetch(), which PoCL ignores, fetches them early. Only where the kernel
// is compiled straight to a processor's own instructions; intermediate forms know no such
// instruction.
#ifndef RS_PRIMITIVES_PREFETCH_H
#define RS_PRIMITIVES_PREFETCH_H

#if defined(__has_builtin) && (defined(__x86_64__) || defined(__aarch64__))
#if __has_builtin(__builtin_prefetch)
#define RS_PREFETCH_READ(pointer) __builtin_prefetch((const void*)(size_t)(pointer), 0)
#define RS_PREFETCH_WRITE(pointer) __builtin_prefetch((const void*)(size_t)(pointer), 1)
#endif
#endif
#ifndef RS_PREFETCH_READ
#define RS_PREFETCH_READ(pointer)
#define RS_PREFETCH_WRITE(pointer)
#endif

#endif
