// SPDX-License-Identifier: Apache-2.0
#include "light/environment.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <numbers>

#include "raysplats/error.hpp"
#include "shared/color.h"
#include "shared/sh.h"
#include "trace/sky.hpp"

namespace raysplats {
namespace {

constexpr double kPi = std::numbers::pi;

struct Frame {
  glm::dvec3 right, up, forward;
};

Frame frame_of(const Environment& environment) {
  Frame frame;
  frame.up = {environment.up[0], environment.up[1], environment.up[2]};
  if (!(glm::length(frame.up) > 0)) {
    throw UsageError("The environment's up direction is zero: give another");
  }
  if (!std::isfinite(glm::length(frame.up)) || !std::isfinite(environment.rotation)) {
    throw UsageError(
        "The environment has an up direction or a rotation that is not finite: correct it");
  }
  frame.up = glm::normalize(frame.up);
  glm::dvec3 forward{0, 0, 1};
  if (std::abs(frame.up.z) > 1 - 1e-6) forward = {1, 0, 0};
  forward = glm::normalize(forward - frame.up * glm::dot(frame.up, forward));
  const double angle = static_cast<double>(environment.rotation) * kPi / 180;
  frame.forward = forward * std::cos(angle) + glm::cross(frame.up, forward) * std::sin(angle);
  frame.right = glm::cross(frame.forward, frame.up);
  return frame;
}

// As the kernels take it.
std::array<float, 9> basis(const glm::dvec3& n) {
  std::array<float, 9> out;
  rs_sh_basis(2, static_cast<float>(n.x), static_cast<float>(n.y), static_cast<float>(n.z),
              out.data());
  return out;
}

// The direction of a point of the picture, from 0 to 1 each.
glm::dvec3 direction_of(const Frame& frame, double x, double y) {
  const double polar = kPi * y, around = 2 * kPi * (x - 0.5);
  return std::sin(polar) * (std::sin(around) * frame.right + std::cos(around) * frame.forward) +
         std::cos(polar) * frame.up;
}

// Coefficients of the cosine-weighted mean over the hemisphere: those of the radiance times 1, 2/3
// and 1/4 by band.
std::array<double, 27> light_coefficients(const Environment& environment, const Frame& frame) {
  std::array<double, 27> sums{};
  const auto add = [&](const glm::dvec3& direction, const glm::dvec3& color, double solid_angle) {
    const std::array<float, 9> b = basis(direction);
    for (std::size_t k = 0; k < 9; ++k) {
      const double band = k == 0 ? 1.0 : (k < 4 ? 2.0 / 3.0 : 0.25);
      for (std::size_t c = 0; c < 3; ++c) {
        sums[3 * k + c] += band * static_cast<double>(b[k]) * color[static_cast<int>(c)] *
                           solid_angle * static_cast<double>(environment.color[c]);
      }
    }
  };
  const Image& image = environment.equirect;
  if (image.pixels() == 0) {
    for (std::size_t c = 0; c < 3; ++c) {
      sums[c] = static_cast<double>(environment.color[c]) / static_cast<double>(basis(frame.up)[0]);
    }
    return sums;
  }
  for (int y = 0; y < image.height; ++y) {
    const double top = kPi * y / image.height, bottom = kPi * (y + 1) / image.height;
    const double solid_angle = 2 * kPi / image.width * (std::cos(top) - std::cos(bottom));
    for (int x = 0; x < image.width; ++x) {
      const glm::dvec3 direction =
          direction_of(frame, (x + 0.5) / image.width, (y + 0.5) / image.height);
      add(direction, {image.at(x, y, 0), image.at(x, y, 1), image.at(x, y, 2)}, solid_angle);
    }
  }
  return sums;
}

}  // namespace

bool shows_sky(const Environment& environment) {
  return environment.equirect.pixels() == 0 && !environment.sky.empty();
}

Environment with_drawn_sky(const Environment& environment) {
  Environment out = environment;
  if (!shows_sky(environment)) return out;
  check_sky(environment.sky);
  out.rotation = 0.0f;  // which turns the picture
  const Frame frame = frame_of(out);
  out.rotation = environment.rotation;
  const int degree =
      static_cast<int>(std::lround(std::sqrt(static_cast<double>(environment.sky.size())))) - 1;
  out.equirect = Image(2 * kSkyHeight, kSkyHeight, 3);
  std::array<float, 25> basis{};
  for (int y = 0; y < kSkyHeight; ++y) {
    for (int x = 0; x < out.equirect.width; ++x) {
      const glm::dvec3 d =
          direction_of(frame, (x + 0.5) / out.equirect.width, (y + 0.5) / kSkyHeight);
      rs_sh_basis(degree, static_cast<float>(d.x), static_cast<float>(d.y), static_cast<float>(d.z),
                  basis.data());
      for (std::size_t c = 0; c < 3; ++c) {
        float sum = 0.5f;
        for (std::size_t k = 0; k < environment.sky.size(); ++k)
          sum += basis[k] * environment.sky[k][c];
        out.equirect.at(x, y, static_cast<int>(c)) = std::clamp(sum, 0.0f, RS_MAX_COLOR);
      }
    }
  }
  return out;
}

RsEnvironment environment_record(const Environment& environment) {
  const Image& image = environment.equirect;
  if (image.pixels() > 0 && (image.channels != 3 || image.data.size() != 3 * image.pixels())) {
    throw UsageError("The environment's picture must have three channels, all of them in its data");
  }
  const Frame frame = frame_of(environment);
  RsEnvironment out{};
  out.width = image.pixels() > 0 ? image.width : 0;
  out.height = image.pixels() > 0 ? image.height : 0;
  for (int k = 0; k < 3; ++k) {
    out.color[k] = environment.color[static_cast<std::size_t>(k)];
    out.right[k] = static_cast<float>(frame.right[k]);
    out.up[k] = static_cast<float>(frame.up[k]);
    out.forward[k] = static_cast<float>(frame.forward[k]);
  }
  const std::array<double, 27> light = light_coefficients(environment, frame);
  for (std::size_t k = 0; k < light.size(); ++k) out.light[k] = static_cast<float>(light[k]);
  return out;
}

}  // namespace raysplats
