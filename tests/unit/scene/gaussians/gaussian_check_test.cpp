// SPDX-License-Identifier: Apache-2.0
#include "scene/gaussians/gaussian_check.hpp"

#include <doctest/doctest.h>

#include <string>

#include "raysplats/error.hpp"

using namespace raysplats;

TEST_CASE("quaternions that single precision cannot normalise are refused by their number") {
  Gaussians model;
  model.resize(3);
  check_gaussians(model);
  for (const float length : {1e-10f, 1e10f}) {
    model.quaternions[8] = length;
    check_gaussians(model);
  }
  for (const float length : {0.0f, 1e-20f, 1e20f}) {
    CAPTURE(length);
    model.quaternions[8] = length;
    std::string message;
    try {
      check_gaussians(model);
    } catch (const DataError& error) {
      message = error.what();
    }
    CHECK(message.find("The quaternion of Gaussian 2 has the length") == 0);
    CHECK(message.find("normalise it") != std::string::npos);
  }
}
