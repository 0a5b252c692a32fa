// SPDX-License-Identifier: Apache-2.0
#pragma once

// The public class with what its kernels need.
#include "device/build_options.hpp"
#include "device/kernel.hpp"
#include "raysplats/context.hpp"
