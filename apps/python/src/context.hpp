// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "process.hpp"
#include "raysplats/context.hpp"
#include "raysplats/model.hpp"

namespace raysplats::python {

using HeldContext = Held<Context>;
using HeldModel = Held<Model>;

}  // namespace raysplats::python
