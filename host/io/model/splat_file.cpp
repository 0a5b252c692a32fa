// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <vector>

#include "io/byte_reader.hpp"
#include "io/model/broken_gaussians.hpp"
#include "io/model/gaussian_codes.hpp"
#include "io/model/model_formats.hpp"
#include "raysplats/error.hpp"
#include "util/atomic_file.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kRecord = 32;

void put_float(std::vector<std::byte>& to, float value) {
  std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
  for (int i = 0; i < 4; ++i, bits >>= 8) to.push_back(static_cast<std::byte>(bits & 0xff));
}

}  // namespace

Gaussians read_splat(const std::filesystem::path& path, bool drop_nonfinite) {
  const std::vector<std::byte> bytes = read_file(path);
  if (bytes.size() % kRecord != 0) {
    throw DataError(fmt::format(
        "{} is truncated or no .splat file: its {} bytes are no whole number of records of {} "
        "bytes",
        path.string(), bytes.size(), kRecord));
  }
  ByteReader reader(bytes, path);
  Gaussians model;
  model.resize(bytes.size() / kRecord);
  BrokenGaussians broken;
  for (std::size_t i = 0; i < model.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      model.means[3 * i + k] = reader.read<float>("a position");
      if (!std::isfinite(model.means[3 * i + k])) broken.add(i, "position");
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const auto scale = reader.read<float>("a scale");
      if (!std::isfinite(scale)) broken.add(i, "scale");
      if (std::isfinite(scale) && scale < 0.0f) reader.fail("a scale is negative");
      model.log_scales[3 * i + k] = scale > 0.0f ? std::log(scale) : kFlatLogScale;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      model.sh[3 * i + k] =
          static_cast<float>((reader.read<std::uint8_t>("a colour") / 255.0 - 0.5) / kSh0);
    }
    model.opacities[i] = logit_of(reader.read<std::uint8_t>("an opacity") / 255.0);
    float q[4];
    for (float& part : q) {
      part = static_cast<float>((reader.read<std::uint8_t>("a rotation") - 128.0) / 128.0);
    }
    const std::array<double, 4> unit = unit_quaternion(q);
    for (std::size_t k = 0; k < 4; ++k) model.quaternions[4 * i + k] = static_cast<float>(unit[k]);
  }
  broken.settle(model, path, drop_nonfinite);
  return model;
}

void write_splat(const std::filesystem::path& path, const Gaussians& model) {
  const std::size_t stride = 3 * static_cast<std::size_t>(sh_coefficients(model.sh_degree));
  std::vector<double> weights(model.size());
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float* s = &model.log_scales[3 * i];
    weights[i] = static_cast<double>(s[0]) + static_cast<double>(s[1]) + static_cast<double>(s[2]) +
                 std::log(opacity_of(model.opacities[i]));
  }
  std::vector<std::size_t> order(model.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return weights[a] > weights[b]; });
  std::vector<std::byte> bytes;
  bytes.reserve(kRecord * model.size());
  const auto put = [&](double value) { bytes.push_back(std::byte{to_byte(value)}); };
  for (const std::size_t i : order) {
    for (std::size_t k = 0; k < 3; ++k) put_float(bytes, model.means[3 * i + k]);
    for (std::size_t k = 0; k < 3; ++k)
      put_float(bytes, std::exp(std::min(model.log_scales[3 * i + k], kMostLogScale)));
    for (std::size_t k = 0; k < 3; ++k)
      put(255.0 * (0.5 + kSh0 * static_cast<double>(model.sh[stride * i + k])));
    put(255.0 * opacity_of(model.opacities[i]));
    for (const double part : unit_quaternion(&model.quaternions[4 * i])) put(128.0 * part + 128.0);
  }
  AtomicFile file(path);
  file.write(bytes.data(), bytes.size());
  file.commit();
}

}  // namespace raysplats::io
