// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/vec3.hpp>
#include <limits>
#include <map>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "device/context.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/rays.hpp"
#include "reference/gradients.hpp"
#include "reference/scenes.hpp"
#include "reference/tracer.hpp"
#include "scene/options/trace_option_table.hpp"
#include "trace/camera_tracer.hpp"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

namespace raysplats {

/// What a packet of rays may be.
struct Packet {
  PacketShape shape;
  int lanes;

  TraceOptions over(TraceOptions options) const {
    options.packet_shape = shape;
    options.packet_width = lanes;
    return options;
  }
};

inline std::ostream& operator<<(std::ostream& out, const Packet& packet) {
  return out << packet_shape_name(packet.shape) << " of " << packet.lanes;
}

/// Ellipsoids around one place, which overlap in depth from the first to the last: a packet has as
/// many rows open at once as there are Gaussians.
inline Gaussians crowded_scene(std::size_t count) {
  Gaussians out = reference::random_scene(count, 5, 1);
  for (float& mean : out.means) mean *= 0.05f;
  for (float& scale : out.log_scales) scale = 0.2f * scale + std::log(0.4f);
  for (float& opacity : out.opacities) opacity = -4.0f;
  return out;
}

struct Difference {
  double mean = 0;          ///< absolute, over compared values
  double maximum = 0;       ///< over pixels that are no near-ties
  std::size_t excused = 0;  ///< pixels with a decision within `tie_margin` of going the other way
  std::size_t pixels = 0;
};

/// Compares a traced RGBA image with the reference. Pixels on which single precision may decide
/// otherwise (order of near-coincident hits, inside or outside an ellipsoid) count in the mean but
/// not in the maximum; there may be a twentieth of them.
inline Difference compare(const Image& image,
                          const reference::Render& expected,
                          double tie_margin = 1e-5) {
  Difference out;
  out.pixels = expected.pixels();
  for (std::size_t i = 0; i < out.pixels; ++i) {
    const bool tie = expected.margin[i] < tie_margin;
    out.excused += tie ? 1 : 0;
    for (std::size_t c = 0; c < 4; ++c) {
      const double d =
          std::abs(static_cast<double>(image.data[4 * i + c]) - expected.image[c * out.pixels + i]);
      out.mean += d / static_cast<double>(4 * out.pixels);
      if (!(d <= 1e30)) out.maximum = 1e30;
      if (!tie) out.maximum = std::max(out.maximum, d);
    }
  }
  CHECK(out.excused * 20 < out.pixels + 20);
  return out;
}

inline Image trace_image(Context& context,
                         const Gaussians& model,
                         const TraceOptions& options,
                         const Camera& camera,
                         ScaleActivation activation = ScaleActivation::kExp) {
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, activation);
  CameraTracer tracer(context, options);
  tracer.update(gaussians);
  tracer.forward(gaussians, camera);
  return tracer.download_image();
}

/// Whether the device makes one subgroup of a packet of so many rays: only the compiled kernel
/// knows.
inline bool is_one_subgroup(int lanes) {
  if (!test_device().has_subgroups || lanes > 32) return false;
  static std::map<int, bool> known;
  const auto [found, is_new] = known.try_emplace(lanes, true);
  if (!is_new) return found->second;
  Context context = make_test_context();
  try {
    trace_image(context, reference::random_scene(1, 18, 0),
                Packet{PacketShape::kSubgroup, lanes}.over({}), reference::cube_camera(9, 7));
  } catch (const DeviceError& refusal) {
    if (std::string_view(refusal.what()).find("subgroups of a packet") == std::string_view::npos)
      throw;
    MESSAGE("Left out: ", std::string(refusal.what()));
    found->second = false;
  }
  return found->second;
}

/// Every shape of packet in the widths named; subgroups in those that the device makes one of.
inline std::vector<Packet> packets(const std::vector<int>& vectors = {1, 2, 4, 8, 16},
                                   const std::vector<int>& groups = {8, 16, 32, 64}) {
  std::vector<Packet> out;
  for (const int lanes : vectors) out.push_back({PacketShape::kVector, lanes});
  for (const int lanes : groups) out.push_back({PacketShape::kGroup, lanes});
  for (const int lanes : groups) {
    if (is_one_subgroup(lanes)) out.push_back({PacketShape::kSubgroup, lanes});
  }
  return out;
}

/// |a - b| / |b| of two vectors as wholes.
inline double relative_error(const std::vector<float>& a, const std::vector<double>& b) {
  double difference = 0;
  double norm = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    norm += b[i] * b[i];
  }
  return std::sqrt(difference / std::max(norm, 1e-300));
}

/// Gradients on the host.
struct HostGradients {
  std::vector<float> means, quaternions, scales, opacities, sh, screen;

  explicit HostGradients(const GaussianGradients& g)
      : means(g.means.download()),
        quaternions(g.quaternions.download()),
        scales(g.scales.download()),
        opacities(g.opacities.download()),
        sh(g.sh.download()),
        screen(g.screen.download()) {}
  bool operator==(const HostGradients&) const = default;
};

/// Relative errors of gradients.
struct GradientErrors {
  double means, quaternions, scales, opacities, sh;

  /// 1e30 where one is no number.
  double worst() const {
    double out = 0;
    for (const double error : {means, quaternions, scales, opacities, sh})
      out = std::max(out, error <= 1e30 ? error : 1e30);
    return out;
  }
};

template <class Expected>
GradientErrors errors_of(const HostGradients& got, const Expected& expected) {
  const auto error = [](const std::vector<float>& a, const auto& b) {
    return relative_error(a, std::vector<double>(b.begin(), b.end()));
  };
  return {error(got.means, expected.means), error(got.quaternions, expected.quaternions),
          error(got.scales, expected.scales), error(got.opacities, expected.opacities),
          error(got.sh, expected.sh)};
}

#define CHECK_ERRORS(errors, limit)                                                  \
  do {                                                                               \
    const GradientErrors e_ = errors;                                                \
    INFO("means ", e_.means, " quaternions ", e_.quaternions, " scales ", e_.scales, \
         " opacities ", e_.opacities, " sh ", e_.sh);                                \
    CHECK(e_.worst() < (limit));                                                     \
  } while (false)

/// Compares what density control reads: gradient in the picture, its absolute sum, whether a ray
/// met it and what rays blend.
inline void check_screen(const HostGradients& got,
                         const HostGradients& expected,
                         double limit,
                         double limit_absolute) {
  std::vector<float> screen, absolute, blended;
  std::vector<double> expected_screen, expected_absolute, expected_blended;
  REQUIRE(got.screen.size() == expected.screen.size());
  for (std::size_t i = 0; i < got.screen.size(); i += GaussianGradients::kScreenNumbers) {
    CHECK(got.screen[i + 2] == expected.screen[i + 2]);
    screen.push_back(got.screen[i]);
    absolute.push_back(got.screen[i + 1]);
    expected_screen.push_back(expected.screen[i]);
    expected_absolute.push_back(expected.screen[i + 1]);
    blended.push_back(got.screen[i + 3]);
    expected_blended.push_back(expected.screen[i + 3]);
  }
  CHECK(relative_error(blended, expected_blended) < limit_absolute);
  CHECK(relative_error(screen, expected_screen) < limit);
  CHECK(relative_error(absolute, expected_absolute) < limit_absolute);
}

/// Calls `check(model, options, activation)` for every order of hits, kind of radius and activation
/// of scales.
template <class Check>
void for_every_variant(Gaussians model, const Check& check) {
  // Sigmoid scales stay below 1.
  for (float& scale : model.log_scales) scale = std::min(scale, -0.2f);
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    for (const bool adaptive : {false, true}) {
      for (const ScaleActivation activation : {ScaleActivation::kExp, ScaleActivation::kSigmoid}) {
        CAPTURE(static_cast<int>(order));
        CAPTURE(adaptive);
        CAPTURE(static_cast<int>(activation));
        TraceOptions options;
        options.hit_order = order;
        options.adaptive_radius = adaptive;
        options.background = {0.25f, 0.5f, 1.0f};
        check(model, options, activation);
      }
    }
  }
}

/// The end of a ray that has none.
constexpr float kFar = std::numeric_limits<float>::max();

inline Ray make_ray(const glm::dvec3& o,
                    const glm::dvec3& d,
                    float t_min = 0.0f,
                    float t_max = kFar) {
  Ray ray{};
  for (int k = 0; k < 3; ++k) {
    ray.origin[k] = static_cast<float>(o[k]);
    ray.direction[k] = static_cast<float>(d[k]);
  }
  ray.t_min = t_min;
  ray.t_max = t_max;
  return ray;
}

/// Rays from places of this spread around the origin towards targets of another, some of them
/// short, the others up to `far`.
inline std::vector<Ray> random_rays(std::size_t count,
                                    std::uint64_t seed,
                                    double spread = 1.0,
                                    double target_spread = 0.6,
                                    float far = kFar) {
  CounterRng rng(seed, 6);
  std::vector<Ray> rays;
  rays.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const glm::dvec3 o = spread * glm::dvec3(rng.normal(), rng.normal(), rng.normal());
    const glm::dvec3 target = target_spread * glm::dvec3(rng.normal(), rng.normal(), rng.normal());
    const glm::dvec3 d = (target - o) * std::exp(rng.normal());
    const float t_min = i % 3 == 0 ? 0.2f : 0.0f;
    rays.push_back(make_ray(o, d, t_min, i % 4 == 0 ? t_min + 1.0f : far));
  }
  return rays;
}

/// What the last forward pass of a tracer gives for this gradient of its picture (planar).
inline HostGradients backward(Context& context,
                              CameraTracer& tracer,
                              const DeviceGaussians& gaussians,
                              const std::vector<float>& image_gradient) {
  Buffer<float> uploaded(context, image_gradient.size(), "image gradient");
  uploaded.upload(image_gradient);
  GaussianGradients out;
  tracer.backward(gaussians, uploaded, out);
  return HostGradients(out);
}

inline std::vector<float> random_image_gradient(std::size_t pixels, std::uint64_t seed) {
  CounterRng rng(seed, 77);
  std::vector<float> out(4 * pixels);
  for (float& value : out) value = static_cast<float>(rng.normal());
  return out;
}

}  // namespace raysplats
