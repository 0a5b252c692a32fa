// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "io/model/broken_gaussians.hpp"
#include "io/model/gaussian_codes.hpp"
#include "io/model/model_formats.hpp"
#include "io/model/ply_options.hpp"
#include "io/model/ply_origin.hpp"
#include "io/ply_file.hpp"
#include "raysplats/error.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/io.hpp"
#include "scene/gaussians/gaussian_check.hpp"
#include "util/atomic_file.hpp"

namespace raysplats {
namespace {

std::size_t coefficients(int degree) { return static_cast<std::size_t>(sh_coefficients(degree)); }

/// Columns of the file in the order of a Gaussian's numbers in memory.
struct Columns {
  int sh_degree = 0;
  std::array<std::size_t, 3> mean{}, log_scale{};
  bool flat = false;  ///< without a third scale: a model of 2D Gaussian Splatting
  std::array<std::size_t, 4> quaternion{};
  std::size_t opacity = 0;
  std::optional<std::size_t> filter;  ///< of Mip-Splatting
  std::vector<std::size_t> sh;        ///< coefficients x 3
  bool bytes = false;                 ///< the first three are colours from 0 to 255
};

int degree_of_rest(std::size_t count, const std::filesystem::path& path) {
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    if (count == 3 * (coefficients(degree) - 1)) return degree;
  }
  throw DataError(
      fmt::format("{} has {} f_rest properties, which is no spherical-harmonics degree from 0 to 4 "
                  "(0, 9, 24, 45 or 72)",
                  path.string(), count));
}

constexpr std::array<const char*, 3> kColorNames{"red", "green", "blue"};

/// Whether colours are bytes in place of harmonics, as splatfacto's export writes them on request.
bool has_byte_colors(const io::PlyFile& file) {
  return !file.column("f_dc_0") &&
         std::all_of(kColorNames.begin(), kColorNames.end(), [&](const char* name) {
           const auto column = file.column(name);
           return column && file.properties()[*column].type == io::PlyType::kUint8;
         });
}

Columns find_columns(const io::PlyFile& file, const std::filesystem::path& path) {
  Columns columns;
  std::vector<std::string> missing;
  const auto find = [&](const std::string& name) -> std::size_t {
    const auto column = file.column(name);
    if (!column) missing.push_back(name);
    return column.value_or(0);
  };
  const std::array<const char*, 3> axes{"x", "y", "z"};
  for (std::size_t i = 0; i < 3; ++i) columns.mean[i] = find(axes[i]);
  columns.sh.resize(3);
  columns.bytes = has_byte_colors(file);
  for (std::size_t i = 0; i < 3; ++i)
    columns.sh[i] = find(columns.bytes ? kColorNames[i] : fmt::format("f_dc_{}", i));
  columns.opacity = find("opacity");
  columns.filter = file.column("filter_3D");
  columns.flat = file.column("scale_1") && !file.column("scale_2");
  for (std::size_t i = 0; i < (columns.flat ? 2 : 3); ++i)
    columns.log_scale[i] = find(fmt::format("scale_{}", i));
  for (std::size_t i = 0; i < 4; ++i) columns.quaternion[i] = find(fmt::format("rot_{}", i));
  if (!missing.empty()) {
    throw DataError(fmt::format("{} is no 3D Gaussian model: it has no {}", path.string(),
                                fmt::join(missing, ", ")));
  }
  std::size_t rest = 0;
  for (const io::PlyProperty& property : file.properties()) {
    if (property.name.starts_with("f_rest_")) ++rest;
  }
  columns.sh_degree = degree_of_rest(rest, path);
  const std::size_t higher = coefficients(columns.sh_degree) - 1;
  for (std::size_t k = 0; k < higher; ++k) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      columns.sh.push_back(find(fmt::format("f_rest_{}", channel * higher + k)));
    }
  }
  if (!missing.empty()) {
    throw DataError(fmt::format("{} has {} f_rest properties but no {}", path.string(), rest,
                                fmt::join(missing, ", ")));
  }
  return columns;
}

/// Widens a Gaussian by the standard deviation of Mip-Splatting's 3D smoothing filter (Yu et al.
/// 2024, equation 9), which its trainer keeps beside scales and opacity: variances are added and
/// the opacity falls as the volume grows. By logarithms, so that no scale is too large.
void widen(float* log_scales, float& opacity, double filter) {
  if (filter == 0.0) return;
  const double log_filter = std::log(std::abs(filter));
  double log_growth = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto before = static_cast<double>(log_scales[axis]);
    const double after = std::max(before, log_filter) +
                         0.5 * std::log1p(std::exp(-2.0 * std::abs(before - log_filter)));
    log_scales[axis] = static_cast<float>(after);
    log_growth += after - before;
  }
  opacity = io::logit_of(io::opacity_of(opacity) * std::exp(-log_growth));
}

/// What the positions of a model are to count from because floats would blur them.
std::array<double, 3> taken_off(const io::PlyFile& file, const std::filesystem::path& path) {
  // One that the header says has been taken off already.
  if (!io::lacks_origin(path)) return {};
  const std::array<double, 3> origin = io::origin_of_doubles(file);
  if (origin == std::array<double, 3>{}) return origin;
  spdlog::info("{}: positions are doubles that floats would blur, and count from {}, {}, {}",
               path.string(), origin[0], origin[1], origin[2]);
  return origin;
}

/// Says what of a file is not 3DGS's own.
void tell_of_form(const Columns& columns, const std::filesystem::path& path) {
  if (columns.filter) {
    spdlog::info("{}: the 3D filter of Mip-Splatting is taken into scales and opacities",
                 path.string());
  }
  if (columns.flat) {
    spdlog::info("{} has no scale_2: its Gaussians are flat, as those of 2D Gaussian Splatting",
                 path.string());
  }
  if (columns.bytes) {
    spdlog::info(
        "{} has red, green and blue in place of harmonics: its colours do not change with "
        "the view",
        path.string());
  }
}

/// Turns rows of a file into Gaussians.
class RowReader {
 public:
  RowReader(const io::PlyFile& file, const std::filesystem::path& path)
      : file_(file),
        path_(path),
        columns_(find_columns(file, path)),
        origin_(taken_off(file, path)) {
    model_.sh_degree = columns_.sh_degree;
    model_.resize(file.rows());
  }

  void read(std::size_t row, std::span<const double> values) {
    row_ = row;
    values_ = values;
    for (std::size_t i = 0; i < 3; ++i) {
      model_.means[3 * row + i] = number(columns_.mean[i], origin_[i]);
      model_.log_scales[3 * row + i] =
          columns_.flat && i == 2 ? io::kFlatLogScale
                                  : limited(columns_.log_scale[i], io::kFlatLogScale, HUGE_VALF);
    }
    read_rotation(&model_.quaternions[4 * row]);
    model_.opacities[row] = limited(columns_.opacity, io::logit_of(0), io::logit_of(1));
    if (columns_.filter) {
      widen(&model_.log_scales[3 * row], model_.opacities[row],
            static_cast<double>(number(*columns_.filter)));
    }
    read_colors(&model_.sh[columns_.sh.size() * row]);
  }

  /// The model, after what is unusual has been said. Throws DataError where numbers are not finite,
  /// unless such Gaussians are to be dropped.
  Gaussians finish(bool drop_nonfinite) {
    tell_of_form(columns_, path_);
    if (infinite_ > 0) {
      spdlog::warn(
          "{}: {} infinite opacities and sizes of 0 are taken as the most opaque, the faintest and "
          "the flattest that there are",
          path_.string(), infinite_);
    }
    broken_.settle(model_, path_, drop_nonfinite);
    if (without_rotation_ > 0) {
      spdlog::warn("{}: {} Gaussians have a zero quaternion and are taken as not rotated",
                   path_.string(), without_rotation_);
    }
    return std::move(model_);
  }

 private:
  float number(std::size_t column, double taken = 0.0) {
    const auto value = static_cast<float>(values_[column] - taken);
    if (!std::isfinite(value)) broken_.add(row_, file_.properties()[column].name);
    return value;
  }

  /// Whole opacities and flat Gaussians, as programs write them that know linear numbers.
  float limited(std::size_t column, float least, float most) {
    const auto value = static_cast<float>(values_[column]);
    if (!std::isinf(value) || (value > 0 && most == HUGE_VALF)) return number(column);
    ++infinite_;
    return value > 0 ? most : least;
  }

  void read_rotation(float* quaternion) {
    double norm = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      quaternion[i] = number(columns_.quaternion[i]);
      norm += static_cast<double>(quaternion[i]) * static_cast<double>(quaternion[i]);
    }
    if (norm == 0) {
      quaternion[0] = 1.0f;
      ++without_rotation_;
    } else if (const double length = std::sqrt(norm);
               length < kShortestQuaternion || length > kLongestQuaternion) {
      const std::array<double, 4> unit = io::unit_quaternion(quaternion);
      for (std::size_t k = 0; k < 4; ++k) quaternion[k] = static_cast<float>(unit[k]);
    }
  }

  void read_colors(float* sh) {
    for (std::size_t k = 0; k < columns_.sh.size(); ++k) sh[k] = number(columns_.sh[k]);
    for (std::size_t k = 0; columns_.bytes && k < 3; ++k)
      sh[k] = static_cast<float>((values_[columns_.sh[k]] / 255.0 - 0.5) / io::kSh0);
  }

  const io::PlyFile& file_;
  const std::filesystem::path& path_;
  Columns columns_;
  std::array<double, 3> origin_;
  Gaussians model_;
  std::size_t row_ = 0;  // of values_
  std::span<const double> values_;
  std::size_t without_rotation_ = 0, infinite_ = 0;
  io::BrokenGaussians broken_;
};

}  // namespace

Gaussians read_ply(const std::filesystem::path& path, bool drop_nonfinite) {
  const io::PlyFile file(path);
  if (file.column("packed_position")) return io::read_compressed_ply(path);
  RowReader reader(file, path);
  file.for_each_row(
      [&](std::size_t row, std::span<const double> values) { reader.read(row, values); });
  return reader.finish(drop_nonfinite);
}

void write_ply(const std::filesystem::path& path,
               const Gaussians& model,
               const std::optional<TraceOptions>& trace,
               const std::array<double, 3>& origin) {
  check_gaussians(model);
  io::write_ply_as_it_is(path, model, trace, origin);
}

void io::write_ply_as_it_is(const std::filesystem::path& path,
                            const Gaussians& model,
                            const std::optional<TraceOptions>& trace,
                            const std::array<double, 3>& origin) {
  check_sizes(model);
  const std::size_t count = model.size();
  const std::size_t bands = coefficients(model.sh_degree);
  std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment Generated by raysplats {}\ncomment SH degree: "
      "{}\n{}{}element vertex {}\n",
      RAYSPLATS_VERSION, model.sh_degree, trace ? io::ply_option_comments(*trace) : "",
      io::ply_origin_comment(origin), count);
  std::size_t columns = 0;
  const auto property = [&](const std::string& name) {
    header += "property float " + name + "\n";
    ++columns;
  };
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"})
    property(name);
  for (std::size_t i = 0; i < 3 * (bands - 1); ++i) property(fmt::format("f_rest_{}", i));
  for (const char* name :
       {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    property(name);
  }
  header += "end_header\n";

  AtomicFile file(path);
  file.write(header);
  std::vector<float> rows;
  constexpr std::size_t kRowsPerWrite = 4096;
  rows.reserve(kRowsPerWrite * columns);
  const auto flush = [&] {
    if constexpr (std::endian::native == std::endian::big) {
      for (float& value : rows) {
        auto raw = std::bit_cast<std::array<std::byte, sizeof(float)>>(value);
        std::reverse(raw.begin(), raw.end());
        value = std::bit_cast<float>(raw);
      }
    }
    file.write(rows.data(), rows.size() * sizeof(float));
    rows.clear();
  };
  for (std::size_t i = 0; i < count; ++i) {
    const float* sh = &model.sh[3 * bands * i];
    const float* q = &model.quaternions[4 * i];
    rows.insert(rows.end(), {model.means[3 * i], model.means[3 * i + 1], model.means[3 * i + 2]});
    rows.insert(rows.end(), {0.0f, 0.0f, 0.0f, sh[0], sh[1], sh[2]});
    for (std::size_t channel = 0; channel < 3; ++channel) {
      for (std::size_t k = 1; k < bands; ++k) rows.push_back(sh[3 * k + channel]);
    }
    rows.push_back(model.opacities[i]);
    for (std::size_t axis = 0; axis < 3; ++axis) rows.push_back(model.log_scales[3 * i + axis]);
    double norm = 0;
    for (std::size_t c = 0; c < 4; ++c)
      norm += static_cast<double>(q[c]) * static_cast<double>(q[c]);
    norm = std::sqrt(norm);
    for (std::size_t c = 0; c < 4; ++c) {
      const float identity = c == 0 ? 1.0f : 0.0f;
      rows.push_back(norm > 0 ? static_cast<float>(static_cast<double>(q[c]) / norm) : identity);
    }
    if (rows.size() >= kRowsPerWrite * columns) flush();
  }
  flush();
  file.commit();
}

}  // namespace raysplats
