// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "io/model/gaussian_codes.hpp"
#include "io/model/model_formats.hpp"
#include "io/ply_file.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kChunk = 256;
constexpr std::size_t kRanges = 9;  ///< of x y z, scale_x.., r g b

/// Least and greatest of everything in a chunk.
struct Chunk {
  std::array<double, kRanges> low{}, high{};
};

const std::array<const char*, kRanges> kRangeNames{"x",       "y", "z", "scale_x", "scale_y",
                                                   "scale_z", "r", "g", "b"};

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& message) {
  throw DataError(fmt::format("{} is no valid compressed PLY: {}", path.string(), message));
}

std::size_t column(const PlyFile& file,
                   const std::string& name,
                   const std::filesystem::path& path) {
  const auto found = file.column(name);
  if (!found) fail(path, fmt::format("it has no {}", name));
  return *found;
}

std::vector<Chunk> read_chunks(const std::filesystem::path& path, std::size_t count) {
  const PlyFile file(path, "chunk");
  if (file.rows() != (count + kChunk - 1) / kChunk) {
    fail(path, fmt::format("{} Gaussians have {} chunks", count, file.rows()));
  }
  // Colours of old files are between 0 and 1.
  const std::size_t ranges = file.column("min_r") ? kRanges : kRanges - 3;
  std::array<std::size_t, kRanges> low{}, high{};
  for (std::size_t k = 0; k < ranges; ++k) {
    low[k] = column(file, fmt::format("min_{}", kRangeNames[k]), path);
    high[k] = column(file, fmt::format("max_{}", kRangeNames[k]), path);
  }
  std::vector<Chunk> chunks(file.rows());
  file.for_each_row([&](std::size_t row, std::span<const double> values) {
    for (std::size_t k = 0; k < kRanges; ++k) {
      chunks[row].low[k] = k < ranges ? values[low[k]] : 0.0;
      chunks[row].high[k] = k < ranges ? values[high[k]] : 1.0;
      if (!std::isfinite(chunks[row].low[k]) || !std::isfinite(chunks[row].high[k])) {
        fail(path, fmt::format("the range of {} of chunk {} is not finite", kRangeNames[k], row));
      }
    }
  });
  return chunks;
}

/// `bits` bits of `word` from `shift` on as 0 to 1.
double unit(std::uint32_t word, int shift, int bits) {
  const std::uint32_t mask = (1u << bits) - 1u;
  return static_cast<double>(word >> shift & mask) / mask;
}

/// Three numbers of 11, 10 and 11 bits within the chunk's ranges from `first` on.
void unpack_three(const Chunk& chunk, std::size_t first, std::uint32_t word, float* out) {
  const std::array<double, 3> part{unit(word, 21, 11), unit(word, 11, 10), unit(word, 0, 11)};
  for (std::size_t k = 0; k < 3; ++k) {
    const double low = chunk.low[first + k];
    out[k] = static_cast<float>(low + part[k] * (chunk.high[first + k] - low));
  }
}

/// Which of w, x, y, z is the largest, and the others in 10 bits each.
void unpack_rotation(std::uint32_t word, float* q) {
  const std::size_t largest = word >> 30;
  double rest = 1.0;
  int shift = 20;
  for (std::size_t k = 0; k < 4; ++k) {
    if (k == largest) continue;
    const double part = (unit(word, shift, 10) - 0.5) * std::numbers::sqrt2;
    q[k] = static_cast<float>(part);
    rest -= part * part;
    shift -= 10;
  }
  q[largest] = static_cast<float>(std::sqrt(std::max(rest, 0.0)));
}

/// SH values lie between -4 and 4; the ends of the code stand for the ends, the others for the
/// middle of their step.
double harmonic(double code) {
  const double n = code == 0.0 ? 0.0 : (code == 255.0 ? 1.0 : (code + 0.5) / 256.0);
  return 8.0 * (n - 0.5);
}

int degree_of(std::size_t properties, const std::filesystem::path& path) {
  for (int degree = 1; degree <= 3; ++degree) {
    if (properties == 3 * static_cast<std::size_t>(sh_coefficients(degree) - 1)) return degree;
  }
  fail(path, fmt::format("its sh element has {} properties (9, 24 or 45 are known)", properties));
}

void read_harmonics(const std::filesystem::path& path, Gaussians& model) {
  const PlyFile file(path, "sh");
  if (file.rows() != model.size()) {
    fail(path, fmt::format("{} Gaussians have {} rows of SH", model.size(), file.rows()));
  }
  const std::size_t count = file.properties().size();
  const std::size_t higher = count / 3;
  model = with_sh_degree(model, degree_of(count, path));
  std::vector<std::size_t> columns;
  for (std::size_t k = 0; k < count; ++k) {
    // In memory colours are innermost, in the file the coefficients.
    columns.push_back(column(file, fmt::format("f_rest_{}", k % 3 * higher + k / 3), path));
  }
  file.for_each_row([&](std::size_t row, std::span<const double> values) {
    float* sh = &model.sh[(count + 3) * row + 3];
    for (std::size_t k = 0; k < count; ++k) {
      const double code = values[columns[k]];
      if (!(code >= 0.0 && code <= 255.0)) fail(path, fmt::format("an SH value is {}", code));
      sh[k] = static_cast<float>(harmonic(code));
    }
  });
}

}  // namespace

Gaussians read_compressed_ply(const std::filesystem::path& path) {
  Gaussians model;
  bool has_harmonics = false;
  {
    const PlyFile file(path);
    const std::vector<Chunk> chunks = read_chunks(path, file.rows());
    const std::size_t position = column(file, "packed_position", path);
    const std::size_t rotation = column(file, "packed_rotation", path);
    const std::size_t scale = column(file, "packed_scale", path);
    const std::size_t color = column(file, "packed_color", path);
    for (const std::size_t k : {position, rotation, scale, color}) {
      if (file.properties()[k].type != PlyType::kUint32)
        fail(path, fmt::format("{} is no uint", file.properties()[k].name));
    }
    has_harmonics = file.has_later("sh");
    model.resize(file.rows());
    file.for_each_row([&](std::size_t row, std::span<const double> values) {
      const auto word = [&](std::size_t k) { return static_cast<std::uint32_t>(values[k]); };
      const Chunk& chunk = chunks[row / kChunk];
      unpack_three(chunk, 0, word(position), &model.means[3 * row]);
      unpack_three(chunk, 3, word(scale), &model.log_scales[3 * row]);
      unpack_rotation(word(rotation), &model.quaternions[4 * row]);
      for (std::size_t k = 0; k < 3; ++k) {
        const double low = chunk.low[6 + k];
        const double part = unit(word(color), 24 - 8 * static_cast<int>(k), 8);
        const double value = low + part * (chunk.high[6 + k] - low);
        model.sh[3 * row + k] = static_cast<float>((value - 0.5) / kSh0);
      }
      model.opacities[row] = logit_of(unit(word(color), 0, 8));
    });
  }
  if (has_harmonics) read_harmonics(path, model);
  return model;
}

}  // namespace raysplats::io
