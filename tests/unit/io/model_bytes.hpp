// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <cmath>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include "raysplats/gaussians.hpp"
#include "raysplats/io.hpp"
#include "unit/io/scratch.hpp"
#include "unit/log_capture.hpp"
#include "util/rng.hpp"

namespace raysplats::test {

inline std::string bytes_of(std::initializer_list<int> values) {
  std::string out;
  for (const int value : values) out.push_back(static_cast<char>(value));
  return out;
}

inline std::span<const std::byte> as_span(const std::string& text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

/// Gaussians as training leaves them: unit quaternions, scales of some hundredths.
inline Gaussians trained_like(std::size_t count, int degree) {
  Gaussians model;
  model.sh_degree = degree;
  model.resize(count);
  CounterRng rng(11, count);
  for (float& x : model.means) x = static_cast<float>(3.0 * rng.normal());
  for (float& s : model.log_scales) s = static_cast<float>(-4.0 + rng.normal());
  for (float& o : model.opacities) o = static_cast<float>(2.0 * rng.normal());
  for (float& c : model.sh) c = static_cast<float>(0.2 * rng.normal());
  for (std::size_t i = 0; i < count; ++i) {
    double q[4];
    double norm = 0;
    for (double& part : q) {
      part = rng.normal();
      norm += part * part;
    }
    for (std::size_t k = 0; k < 4; ++k)
      model.quaternions[4 * i + k] = static_cast<float>(q[k] / std::sqrt(norm));
  }
  return model;
}

/// Greatest difference of two arrays of one length.
inline double farthest(const std::vector<float>& a, const std::vector<float>& b) {
  REQUIRE(a.size() == b.size());
  double most = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    most = std::max(most, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  return most;
}

/// The same of rotations, which two quaternions stand for.
inline double farthest_rotation(const std::vector<float>& a, const std::vector<float>& b) {
  REQUIRE(a.size() == b.size());
  double most = 0.0;
  for (std::size_t i = 0; i < a.size(); i += 4) {
    double dot = 0.0;
    for (std::size_t k = 0; k < 4; ++k)
      dot += static_cast<double>(a[i + k]) * static_cast<double>(b[i + k]);
    most = std::max(most, 1.0 - std::abs(dot));
  }
  return most;
}

/// Every truncation of a file and every bit turned over ends in a model of finite numbers or in one
/// sentence with the file's name. Returns how many were refused.
inline std::size_t check_damage(const std::string& bytes, const std::string& name) {
  const Scratch scratch;
  const LogCapture log;
  std::size_t refused = 0;
  const auto attempt = [&](const std::string& damaged) {
    write_bytes(scratch / name, damaged);
    const std::string message = data_error([&] {
      const Gaussians model = read_model(scratch / name);
      for (const auto* values :
           {&model.means, &model.quaternions, &model.log_scales, &model.opacities, &model.sh}) {
        for (const float value : *values) {
          if (!std::isfinite(value)) FAIL("a number that is not finite was read");
        }
      }
    });
    if (message.empty()) return;
    ++refused;
    CHECK(contains(message, name));
    CHECK(!contains(message, "\n"));
  };
  for (std::size_t length = 0; length < bytes.size(); ++length) attempt(bytes.substr(0, length));
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = bytes;
      damaged[at] = static_cast<char>(damaged[at] ^ (1 << bit));
      attempt(damaged);
    }
  }
  return refused;
}

}  // namespace raysplats::test
