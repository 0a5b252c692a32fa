// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "io/image/webp_texture.hpp"
#include "io/model/gaussian_codes.hpp"
#include "io/model/model_formats.hpp"
#include "io/model/sog_file.hpp"
#include "io/zip_archive.hpp"
#include "raysplats/error.hpp"
#include "scene/gaussians/quantization.hpp"
#include "scene/morton_order.hpp"
#include "util/atomic_file.hpp"
#include "util/stop_if_interrupted.hpp"

namespace raysplats::io {
namespace {

using Json = nlohmann::ordered_json;
using NamedFiles = std::vector<std::pair<std::string, std::vector<std::byte>>>;

constexpr double kMostStep = 65535.0;
/// Gaussians for each thousand of which there are a thousand entries of the palette.
constexpr std::size_t kPaletteUnit = 1024;
constexpr std::size_t kMostUnits = 64;
/// Gaussians from which on the palette takes so long that one is told.
constexpr std::size_t kToldFrom = 200'000;

/// An opaque texture with room for `count` texels, nearly square with sides in fours.
Texture blank(std::size_t count) {
  Texture texture;
  const double side = std::sqrt(static_cast<double>(count));
  texture.width = std::max<std::size_t>(4, static_cast<std::size_t>(std::ceil(side / 4.0)) * 4);
  const std::size_t rows = (count + texture.width - 1) / texture.width;
  texture.height = std::max<std::size_t>(4, (rows + 3) / 4 * 4);
  texture.rgba.assign(4 * texture.texels(), 0);
  for (std::size_t i = 0; i < texture.texels(); ++i) texture.rgba[4 * i + 3] = 255;
  return texture;
}

/// The numbers of a codebook and as many zeros as it takes: readers want all of them.
Json codebook_json(std::vector<float> levels) {
  levels.resize(kSogLevels, levels.empty() ? 0.0f : levels.back());
  return levels;
}

std::uint8_t code_of(std::span<const float> levels, float value) {
  return static_cast<std::uint8_t>(nearest_level(levels, value));
}

double logarithm(float x) {
  return std::copysign(std::log1p(std::abs(static_cast<double>(x))), static_cast<double>(x));
}

Json add_means(const Gaussians& model, NamedFiles& files) {
  const std::size_t count = model.size();
  Texture low = blank(count), high = blank(count);
  std::array<double, 3> least{}, most{};
  for (std::size_t i = 0; i < 3 * count; ++i) {
    const double n = logarithm(model.means[i]);
    least[i % 3] = i < 3 ? n : std::min(least[i % 3], n);
    most[i % 3] = i < 3 ? n : std::max(most[i % 3], n);
  }
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double range = most[k] - least[k];
      const double part =
          range > 0.0 ? (logarithm(model.means[3 * i + k]) - least[k]) / range : 0.0;
      const auto step =
          static_cast<unsigned>(std::clamp(std::round(part * kMostStep), 0.0, kMostStep));
      low.rgba[4 * i + k] = static_cast<std::uint8_t>(step & 0xff);
      high.rgba[4 * i + k] = static_cast<std::uint8_t>(step >> 8);
    }
  }
  files.emplace_back("means_l.webp", encode_texture(low));
  files.emplace_back("means_u.webp", encode_texture(high));
  return {{"mins", least}, {"maxs", most}, {"files", {"means_l.webp", "means_u.webp"}}};
}

Json add_scales(const Gaussians& model, NamedFiles& files) {
  const std::vector<float> levels = best_levels(model.log_scales, kSogLevels);
  Texture texture = blank(model.size());
  for (std::size_t i = 0; i < model.log_scales.size(); ++i)
    texture.rgba[4 * (i / 3) + i % 3] = code_of(levels, model.log_scales[i]);
  files.emplace_back("scales.webp", encode_texture(texture));
  return {{"codebook", codebook_json(levels)}, {"files", {"scales.webp"}}};
}

Json add_rotations(const Gaussians& model, NamedFiles& files) {
  Texture texture = blank(model.size());
  for (std::size_t i = 0; i < model.size(); ++i) {
    const std::array<double, 4> q = unit_quaternion(&model.quaternions[4 * i]);
    std::size_t largest = 0;
    for (std::size_t k = 1; k < 4; ++k) {
      if (std::abs(q[k]) > std::abs(q[largest])) largest = k;
    }
    const double sign = q[largest] < 0.0 ? -1.0 : 1.0;
    std::uint8_t* texel = &texture.rgba[4 * i];
    for (std::size_t k = 0; k < 4; ++k) {
      if (k != largest) *texel++ = to_byte(255.0 * (sign * q[k] / std::numbers::sqrt2 + 0.5));
    }
    *texel = static_cast<std::uint8_t>(kSogRotation + static_cast<int>(largest));
  }
  files.emplace_back("quats.webp", encode_texture(texture));
  return {{"files", {"quats.webp"}}};
}

Json add_colors(const Gaussians& model, NamedFiles& files) {
  const std::size_t stride = 3 * static_cast<std::size_t>(sh_coefficients(model.sh_degree));
  std::vector<float> colors;
  for (std::size_t i = 0; i < model.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) colors.push_back(model.sh[stride * i + k]);
  }
  const std::vector<float> levels = best_levels(colors, kSogLevels);
  Texture texture = blank(model.size());
  for (std::size_t i = 0; i < model.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k)
      texture.rgba[4 * i + k] = code_of(levels, colors[3 * i + k]);
    texture.rgba[4 * i + 3] = to_byte(255.0 * opacity_of(model.opacities[i]));
  }
  files.emplace_back("sh0.webp", encode_texture(texture));
  return {{"codebook", codebook_json(levels)}, {"files", {"sh0.webp"}}};
}

Json add_harmonics(const Gaussians& model, NamedFiles& files) {
  const auto higher = static_cast<std::size_t>(sh_coefficients(model.sh_degree) - 1);
  const std::size_t width = 3 * higher;
  const std::size_t count = model.size();
  std::vector<float> vectors;
  vectors.reserve(width * count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto begin = model.sh.begin() + static_cast<std::ptrdiff_t>((width + 3) * i + 3);
    vectors.insert(vectors.end(), begin, begin + static_cast<std::ptrdiff_t>(width));
  }
  const std::size_t units = std::bit_floor(std::max<std::size_t>(1, count / kPaletteUnit));
  const std::size_t most = std::min(kMostUnits, units) * kPaletteUnit;
  if (count >= kToldFrom) {
    spdlog::info("grouping the SH bands of {} Gaussians into a palette of {}: this takes a while",
                 count, most);
  }
  const VectorPalette palette = vector_palette(vectors, width, most);
  const std::size_t entries = palette.entries.size() / width;
  const std::vector<float> levels = best_levels(palette.entries, kSogLevels);

  Texture centroids;
  centroids.width = kSogEntriesPerRow * higher;
  centroids.height = (entries + kSogEntriesPerRow - 1) / kSogEntriesPerRow;
  centroids.rgba.assign(4 * centroids.texels(), 0);
  for (std::size_t i = 0; i < centroids.texels(); ++i) centroids.rgba[4 * i + 3] = 255;
  for (std::size_t i = 0; i < palette.entries.size(); ++i)
    centroids.rgba[4 * (i / 3) + i % 3] = code_of(levels, palette.entries[i]);
  Texture labels = blank(count);
  for (std::size_t i = 0; i < count; ++i) {
    labels.rgba[4 * i] = static_cast<std::uint8_t>(palette.labels[i] & 0xff);
    labels.rgba[4 * i + 1] = static_cast<std::uint8_t>(palette.labels[i] >> 8);
  }
  files.emplace_back("shN_centroids.webp", encode_texture(centroids));
  files.emplace_back("shN_labels.webp", encode_texture(labels));
  return {{"count", entries},
          {"bands", model.sh_degree},
          {"codebook", codebook_json(levels)},
          {"files", {"shN_centroids.webp", "shN_labels.webp"}}};
}

}  // namespace

void write_sog(const std::filesystem::path& path, const Gaussians& given) {
  Gaussians model = in_morton_order(given);
  if (model.sh_degree > kSogMostDegree) model = with_sh_degree(model, kSogMostDegree);
  if (blank(model.size()).width > kMostTextureSide) {
    throw DataError(fmt::format("{} cannot be written: SOG has at most {} Gaussians, not {}",
                                path.string(), kMostTextureSide / 4 * 4 * kMostTextureSide,
                                model.size()));
  }
  NamedFiles files(1);
  Json meta{{"version", kSogVersion},
            {"asset", {{"generator", "RaySplats-CL " RAYSPLATS_VERSION}}},
            {"count", model.size()}};
  const auto add = [&](const char* name, Json (*part)(const Gaussians&, NamedFiles&)) {
    stop_if_interrupted();
    meta[name] = part(model, files);
  };
  add("means", add_means);
  add("scales", add_scales);
  add("quats", add_rotations);
  add("sh0", add_colors);
  if (model.sh_degree > 0 && model.size() > 0) add("shN", add_harmonics);
  stop_if_interrupted();
  const std::string text = meta.dump();
  const auto* bytes = reinterpret_cast<const std::byte*>(text.data());
  files.front() = {"meta.json", {bytes, bytes + text.size()}};
  // Equal Gaussians pack to next to nothing, which reading does not take for so many.
  std::size_t packed = 0;
  for (const auto& [name, content] : files) packed += content.size();
  const std::size_t least = model.size() / kSogMostPerByte + 1;
  if (model.size() > kAlwaysHeld && packed < least)
    files.emplace_back("padding", std::vector<std::byte>(least - packed));
  const std::vector<std::byte> archive = zip_of(files, path);
  AtomicFile file(path);
  file.write(archive.data(), archive.size());
  file.commit();
}

}  // namespace raysplats::io
