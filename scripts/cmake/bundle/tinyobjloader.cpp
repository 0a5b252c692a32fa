// SPDX-License-Identifier: Apache-2.0
#define TINYOBJLOADER_IMPLEMENTATION
#include <tiny_obj_loader.h>
