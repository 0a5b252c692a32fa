// SPDX-License-Identifier: Apache-2.0
#include "io/scene/ray_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdint>
#include <limits>
#include <string>

#include "io/npy_file.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

template <class T>
NpzMember member(const char* name,
                 const char* type,
                 std::vector<std::size_t> shape,
                 const std::vector<T>& data) {
  return {name, type, std::move(shape), std::as_bytes(std::span<const T>(data))};
}

}  // namespace

RayList read_rays(const std::filesystem::path& path, const std::array<double, 3>& origin) {
  const NpyNumbers<double> array = read_npy_doubles(path);
  const std::size_t width = array.shape.empty() ? 0 : array.shape.back();
  if (width != 6 && width != 8) {
    throw DataError(
        fmt::format("{} has the shape ({}), not (..., 6) or (..., 8): every ray is 3 numbers of "
                    "its origin, 3 of "
                    "its direction and, with 8, t_min and t_max",
                    path.string(), fmt::join(array.shape, ", ")));
  }
  RayList out;
  out.shape.assign(array.shape.begin(), array.shape.end() - 1);
  out.rays.resize(array.data.size() / width);
  for (std::size_t i = 0; i < out.rays.size(); ++i) {
    const double* v = array.data.data() + i * width;
    Ray& ray = out.rays[i];
    for (std::size_t k = 0; k < 3; ++k) {
      ray.origin[k] = static_cast<float>(v[k] - origin[k]);
      ray.direction[k] = static_cast<float>(v[3 + k]);
    }
    const bool ends = width == 8;
    ray.t_min = ends ? static_cast<float>(v[6]) : 0.0f;
    ray.t_max = ends ? static_cast<float>(v[7]) : std::numeric_limits<float>::infinity();
  }
  return out;
}

void write_ray_results(const std::filesystem::path& path,
                       const std::vector<std::size_t>& shape,
                       std::span<const RayResult> results) {
  std::vector<float> color, alpha, depth, median;
  std::vector<std::uint32_t> hits;
  color.reserve(3 * results.size());
  for (const RayResult& result : results) {
    color.insert(color.end(), result.color, result.color + 3);
    alpha.push_back(result.alpha);
    depth.push_back(result.expected_depth);
    median.push_back(result.median_depth);
    hits.push_back(result.hits);
  }
  std::vector<std::size_t> with_channels = shape;
  with_channels.push_back(3);
  const std::vector<NpzMember> members{
      member("color", "<f4", with_channels, color), member("alpha", "<f4", shape, alpha),
      member("depth", "<f4", shape, depth), member("median_depth", "<f4", shape, median),
      member("hits", "<u4", shape, hits)};
  write_npz(path, members);
}

}  // namespace raysplats::io
