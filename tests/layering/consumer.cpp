// SPDX-License-Identifier: Apache-2.0
// Compiled as the source of whoever links the library target, and of nobody who is a part of it.
extern const char* const kConsumerSees;

const char* const kConsumerSees =
#if __has_include("raysplats/context.hpp")
    "public"
#endif
#if __has_include("device/context.hpp")
    " host"
#endif
#if __has_include("shared/layout.h")
    " cl"
#endif
    "";
