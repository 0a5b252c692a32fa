// SPDX-License-Identifier: Apache-2.0
#include "io/model/spz_codes.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>

#include "io/byte_reader.hpp"
#include "io/model/gaussian_codes.hpp"
#include "io/model/model_formats.hpp"
#include "raysplats/error.hpp"
#include "raysplats/gaussians.hpp"

namespace raysplats::io {
namespace {

constexpr int kUsualFractionalBits = 12;
constexpr int kMaxFractionalBits = 24;
constexpr double kScaleStep = 16.0;
constexpr double kPositionLimit = 8388607.0;  // 2^23 - 1
/// Harmonics keep 6 of their 8 bits, as coarser steps compress better: the 5 and 4 bits of
/// Niantic's writer cost half a decibel, since most coefficients are smaller than a step of 4 bits,
/// and the last two bits another 12 bytes for a twentieth of one.
constexpr double kHarmonicStep = 4.0;
constexpr std::uint32_t kRotationMask = 511;

std::uint64_t higher_coefficients(int degree) {
  return static_cast<std::uint64_t>(sh_coefficients(degree) - 1);
}

double byte_at(std::span<const std::byte> bytes, std::size_t i) {
  return std::to_integer<int>(bytes[i]);
}

double half_at(std::span<const std::byte> bytes, std::size_t i) {
  const unsigned bits =
      std::to_integer<unsigned>(bytes[2 * i]) | std::to_integer<unsigned>(bytes[2 * i + 1]) << 8;
  const int exponent = static_cast<int>(bits >> 10 & 31u);
  const int fraction = static_cast<int>(bits & 1023u);
  double value;
  if (exponent == 31) {
    value = fraction == 0 ? HUGE_VAL : std::nan("");
  } else if (exponent == 0) {
    value = std::ldexp(fraction, -24);
  } else {
    value = std::ldexp(1024 + fraction, exponent - 25);
  }
  return (bits & 0x8000u) != 0 ? -value : value;
}

double fixed_at(std::span<const std::byte> bytes, std::size_t i, int fractional_bits) {
  const std::uint32_t bits = std::to_integer<std::uint32_t>(bytes[3 * i]) << 8 |
                             std::to_integer<std::uint32_t>(bytes[3 * i + 1]) << 16 |
                             std::to_integer<std::uint32_t>(bytes[3 * i + 2]) << 24;
  return std::ldexp(static_cast<double>(std::bit_cast<std::int32_t>(bits) >> 8), -fractional_bits);
}

/// Three bytes: x, y and z of the quaternion whose real part is not negative.
void first_three(std::span<const std::byte> bytes, std::size_t i, float* q) {
  double rest = 1.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double part = byte_at(bytes, 3 * i + k) / 127.5 - 1.0;
    q[k + 1] = static_cast<float>(part);
    rest -= part * part;
  }
  q[0] = static_cast<float>(std::sqrt(std::max(rest, 0.0)));
}

/// Four bytes: which of x, y, z, w is the largest, and the three others in 10 bits each.
void smallest_three(std::span<const std::byte> bytes, std::size_t i, float* q) {
  std::uint32_t bits = 0;
  for (std::size_t k = 4; k-- > 0;)
    bits = bits << 8 | std::to_integer<std::uint32_t>(bytes[4 * i + k]);
  const std::size_t largest = bits >> 30;
  double rest = 1.0;
  double xyzw[4];
  for (std::size_t k = 4; k-- > 0;) {
    if (k == largest) continue;
    const double size =
        static_cast<double>(bits & kRotationMask) / kRotationMask / std::numbers::sqrt2;
    xyzw[k] = (bits & 512u) != 0 ? -size : size;
    rest -= size * size;
    bits >>= 10;
  }
  xyzw[largest] = std::sqrt(std::max(rest, 0.0));
  q[0] = static_cast<float>(xyzw[3]);
  for (std::size_t k = 0; k < 3; ++k) q[k + 1] = static_cast<float>(xyzw[k]);
}

std::uint32_t packed_rotation(const float* quaternion) {
  const std::array<double, 4> q = unit_quaternion(quaternion);
  const std::array<double, 4> xyzw{q[1], q[2], q[3], q[0]};
  std::size_t largest = 0;
  for (std::size_t k = 1; k < 4; ++k) {
    if (std::abs(xyzw[k]) > std::abs(xyzw[largest])) largest = k;
  }
  auto bits = static_cast<std::uint32_t>(largest);
  for (std::size_t k = 0; k < 4; ++k) {
    if (k == largest) continue;
    const double size = std::abs(xyzw[k]) * std::numbers::sqrt2 * kRotationMask;
    const bool negative = (xyzw[k] < 0.0) != (xyzw[largest] < 0.0);
    bits = bits << 10 | (negative ? 512u : 0u) |
           std::min(static_cast<std::uint32_t>(std::lround(size)), kRotationMask);
  }
  return bits;
}

std::uint8_t packed_harmonic(float value) {
  const double code = 128.0 * static_cast<double>(value) + 128.0;
  return to_byte(kHarmonicStep * std::floor(code / kHarmonicStep + 0.5));
}

double farthest_position(const Gaussians& model) {
  double largest = 0.0;
  for (const float x : model.means) largest = std::max(largest, std::abs(static_cast<double>(x)));
  return largest;
}

/// The largest standard deviation of every Gaussian, as a logarithm.
std::vector<float> log_sizes(const Gaussians& model) {
  std::vector<float> sizes(model.size());
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const float* scale = &model.log_scales[3 * i];
    sizes[i] = std::max({scale[0], scale[1], scale[2]});
  }
  return sizes;
}

double median_size(const Gaussians& model) {
  std::vector<float> sizes = log_sizes(model);
  if (sizes.empty()) return 1.0;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return std::exp(static_cast<double>(*middle));
}

/// What brings the positions of a model nearer to 0, where all of them or some lie far off.
const char* nearer(const Gaussians& model) {
  double spread = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<float> values;
    for (std::size_t i = axis; i < model.means.size(); i += 3) values.push_back(model.means[i]);
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    const auto center = static_cast<double>(*middle);
    for (const float x : values)
      spread = std::max(spread, std::abs(static_cast<double>(x) - center));
  }
  // A bit behind the point is worth a move.
  return 2.0 * spread <= farthest_position(model)
             ? "all of them lie there, move them to 0 by convert --translate"
             : "leave out what is far away by convert --crop";
}

void warn_of_losses(const Gaussians& model, int bits, const std::filesystem::path& path) {
  const double size = median_size(model);
  const std::vector<float> sizes = log_sizes(model);
  const auto small =
      std::count_if(sizes.begin(), sizes.end(), [](float s) { return s < kSpzLeastLogScale; });
  // One in a hundred is seen.
  if (100 * static_cast<std::size_t>(small) > sizes.size()) {
    const double larger = std::pow(10.0, std::round(std::log10(0.01 / size)));
    spdlog::warn(
        "{}: {} of {} Gaussians are smaller than SPZ can say (4.5e-5) and become as large: scale "
        "the model up, as by convert --scale {:g}",
        path.string(), small, sizes.size(), std::max(larger, 10.0));
  }
  const auto large =
      std::count_if(sizes.begin(), sizes.end(), [](float s) { return s > kSpzMostLogScale; });
  // Skies are of few, but large ones.
  if (1000 * static_cast<std::size_t>(large) > sizes.size()) {
    const float largest = *std::max_element(sizes.begin(), sizes.end());
    const double limit = std::exp(static_cast<double>(kSpzMostLogScale - largest));
    spdlog::warn(
        "{}: {} of {} Gaussians are larger than SPZ can say (380) and become as small, so that "
        "skies and what is far away have holes: scale the model down, as by convert --scale {:g}",
        path.string(), large, sizes.size(), std::pow(10.0, std::floor(std::log10(limit))));
  }
  if (std::ldexp(1.0, -bits) > size) {
    spdlog::warn(
        "{}: SPZ keeps positions to {:g}, which is more than half of the Gaussians are large, "
        "because one is {:.3g} from the origin: {}",
        path.string(), std::ldexp(1.0, -bits), farthest_position(model), nearer(model));
  }
}

}  // namespace

int spz_fractional_bits(const Gaussians& model) {
  const double largest = farthest_position(model), finest = 0.25 * median_size(model);
  int bits = kUsualFractionalBits;
  while (bits < kMaxFractionalBits && std::ldexp(1.0, -bits) > finest) ++bits;
  while (bits > 0 && std::ldexp(largest, bits) > kPositionLimit) --bits;
  return bits;
}

void check_spz_header(const SpzHeader& header,
                      std::uint64_t file_bytes,
                      const std::filesystem::path& path) {
  const auto fail = [&](const std::string& message) {
    throw DataError(fmt::format("{} is no valid SPZ file: {}", path.string(), message));
  };
  if (header.version < 1 || header.version > static_cast<std::uint32_t>(kSpzLastVersion)) {
    fail(fmt::format("its version is {}, but only 1 to {} are known", header.version,
                     kSpzLastVersion));
  }
  if (header.sh_degree > kMaxShDegree) {
    fail(fmt::format("its spherical-harmonics degree is {}", header.sh_degree));
  }
  if (header.fractional_bits > kMaxFractionalBits) {
    fail(fmt::format("its positions have {} bits behind the point", header.fractional_bits));
  }
  const SpzSizes sizes = spz_sizes(header);
  if (header.points > kAlwaysHeld && std::accumulate(sizes.begin(), sizes.end(), std::uint64_t{0}) >
                                         saturating_product(file_bytes, kSpzMostShrinking)) {
    fail(fmt::format("it declares {} Gaussians, more than {} bytes can hold", header.points,
                     file_bytes));
  }
}

SpzSizes spz_sizes(const SpzHeader& header) {
  const std::uint64_t n = header.points;
  return {n * (header.version == 1 ? 6 : 9),
          n,
          3 * n,
          3 * n,
          n * (header.version < 3 ? 3 : 4),
          3 * n * higher_coefficients(header.sh_degree)};
}

Gaussians unpack_spz(const SpzHeader& header,
                     const std::array<std::span<const std::byte>, kSpzArrays>& arrays,
                     const std::filesystem::path& path) {
  const auto& [positions, alphas, colors, scales, rotations, harmonics] = arrays;
  Gaussians model;
  model.sh_degree = header.sh_degree;
  model.resize(header.points);
  const auto higher = 3 * static_cast<std::size_t>(higher_coefficients(header.sh_degree));
  for (std::size_t i = 0; i < 3 * model.size(); ++i) {
    const double position = header.version == 1 ? half_at(positions, i)
                                                : fixed_at(positions, i, header.fractional_bits);
    if (!std::isfinite(position)) {
      throw DataError(
          fmt::format("{}: the position of Gaussian {} is not finite", path.string(), i / 3));
    }
    model.means[i] = static_cast<float>(position);
    model.log_scales[i] = static_cast<float>(byte_at(scales, i) / kScaleStep +
                                             static_cast<double>(kSpzLeastLogScale));
  }
  for (std::size_t i = 0; i < model.size(); ++i) {
    model.opacities[i] = logit_of(byte_at(alphas, i) / 255.0);
    float* q = &model.quaternions[4 * i];
    if (header.version < 3) {
      first_three(rotations, i, q);
    } else {
      smallest_three(rotations, i, q);
    }
    float* sh = &model.sh[(3 + higher) * i];
    for (std::size_t k = 0; k < 3; ++k)
      sh[k] = static_cast<float>((byte_at(colors, 3 * i + k) / 255.0 - 0.5) / kSpzColorScale);
    for (std::size_t k = 0; k < higher; ++k)
      sh[3 + k] = static_cast<float>((byte_at(harmonics, higher * i + k) - 128.0) / 128.0);
  }
  return model;
}

std::array<std::vector<std::byte>, kSpzArrays> pack_spz(const Gaussians& model,
                                                        SpzHeader& header,
                                                        const std::filesystem::path& path) {
  if (model.size() > UINT32_MAX) {
    throw DataError(fmt::format("{} cannot be written: SPZ has at most {} Gaussians, not {}",
                                path.string(), UINT32_MAX, model.size()));
  }
  if (const double largest = farthest_position(model); largest > kPositionLimit) {
    throw DataError(fmt::format(
        "{} cannot be written: SPZ has no position beyond {:.0f}, but one is {:.6g}: {}, "
        "or scale the model down",
        path.string(), kPositionLimit, largest, nearer(model)));
  }
  header.points = static_cast<std::uint32_t>(model.size());
  header.sh_degree = static_cast<std::uint8_t>(model.sh_degree);
  header.fractional_bits = static_cast<std::uint8_t>(spz_fractional_bits(model));
  warn_of_losses(model, header.fractional_bits, path);
  std::array<std::vector<std::byte>, kSpzArrays> arrays;
  const SpzSizes sizes = spz_sizes(header);
  for (std::size_t i = 0; i < kSpzArrays; ++i) arrays[i].reserve(sizes[i]);
  auto& [positions, alphas, colors, scales, rotations, harmonics] = arrays;
  const auto put = [](std::vector<std::byte>& to, std::uint8_t byte) {
    to.push_back(std::byte{byte});
  };
  const auto put_low = [&](std::vector<std::byte>& to, std::uint32_t bits, int bytes) {
    for (int i = 0; i < bytes; ++i, bits >>= 8) put(to, static_cast<std::uint8_t>(bits & 0xff));
  };
  const auto higher = 3 * static_cast<std::size_t>(higher_coefficients(model.sh_degree));
  for (const float x : model.means) {
    const double steps = std::round(std::ldexp(static_cast<double>(x), header.fractional_bits));
    put_low(positions, std::bit_cast<std::uint32_t>(static_cast<std::int32_t>(steps)), 3);
  }
  for (const float logit : model.opacities) put(alphas, to_byte(255.0 * opacity_of(logit)));
  for (const float s : model.log_scales)
    put(scales,
        to_byte(kScaleStep * (static_cast<double>(s) - static_cast<double>(kSpzLeastLogScale))));
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float* sh = &model.sh[(3 + higher) * i];
    for (std::size_t k = 0; k < 3; ++k)
      put(colors, to_byte(255.0 * (kSpzColorScale * static_cast<double>(sh[k]) + 0.5)));
    put_low(rotations, packed_rotation(&model.quaternions[4 * i]), 4);
    for (std::size_t k = 0; k < higher; ++k) put(harmonics, packed_harmonic(sh[3 + k]));
  }
  return arrays;
}

}  // namespace raysplats::io
