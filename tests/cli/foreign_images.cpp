// SPDX-License-Identifier: Apache-2.0
// Libraries of pictures that the program must refuse, for start_up_test.cpp.
#include <cstdint>

extern "C" const char* raysplats_images_version() { return FOREIGN_VERSION; }
#ifdef FOREIGN_INTERFACE
extern "C" std::uint64_t raysplats_images_interface() { return FOREIGN_INTERFACE; }
#endif
// Whoever calls it has not looked before.
extern "C" const void* raysplats_images_codec() { __builtin_trap(); }
