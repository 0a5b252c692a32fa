// SPDX-License-Identifier: Apache-2.0
#include "run/dataset_fingerprint.hpp"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <system_error>
#include <vector>

#include "io/byte_reader.hpp"
#include "scene/camera/photo_lens.hpp"

namespace raysplats {
namespace {

std::uintmax_t size_of(const std::filesystem::path& file) {
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(file, error);
  return error ? 0 : bytes;
}

std::string description(const View& view, bool with_depths) {
  const Camera& camera = view.source_camera;
  std::string text =
      fmt::format("{} {} {}x{} {} {} {} {}", camera.name, size_of(view.image_path), camera.width,
                  camera.height, camera.fx, camera.fy, camera.cx, camera.cy);
  const Distortion& lens = camera.distortion;
  text += fmt::format(" {} {} {} {} {} {} {}", static_cast<int>(camera.model), lens.k1, lens.k2,
                      lens.k3, lens.p1, lens.p2, lens.k4);
  if (camera.lens) {
    const PhotoLens& photo = *camera.lens;
    text += fmt::format(" {} {} {} {} {} {}", static_cast<int>(photo.form), photo.p1, photo.p2,
                        photo.decentred_last, photo.radius, photo.limit);
    for (const double a : photo.radial) text += fmt::format(" {}", a);
    for (const double b : photo.divisor) text += fmt::format(" {}", b);
    for (const double s : photo.prism) text += fmt::format(" {}", s);
  }
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) text += fmt::format(" {}", camera.rotation[column][row]);
    text += fmt::format(" {}", camera.translation[column]);
  }
  if (with_depths && !view.depth_path.empty()) {
    // Arrays of one shape have one size, whatever they hold.
    const std::vector<std::byte> map = io::read_file(view.depth_path);
    text += fmt::format(" {:016x}", XXH64(map.data(), map.size(), 0));
  }
  return text + "\n";
}

}  // namespace

std::string split_fingerprint(const Dataset& dataset) {
  std::vector<std::string> names;
  for (const View& view : dataset.views) {
    if (view.test) names.push_back(view.camera.name);
  }
  std::sort(names.begin(), names.end());
  std::string text;
  for (const std::string& name : names) text += name + "\n";
  return fmt::format("{:016x}", XXH64(text.data(), text.size(), 0));
}

std::string dataset_fingerprint(const Dataset& dataset, bool with_depths) {
  // The order of the views depends on the split.
  std::vector<std::string> lines;
  for (const View& view : dataset.views) lines.push_back(description(view, with_depths));
  std::sort(lines.begin(), lines.end());
  std::string text;
  for (const std::string& line : lines) text += line;
  const std::vector<float>& points = dataset.points.positions;
  const std::vector<float>& colors = dataset.points.colors;
  const XXH64_hash_t views = XXH64(text.data(), text.size(), 0);
  const XXH64_hash_t places = XXH64(points.data(), points.size() * sizeof(float), views);
  return fmt::format("{:016x}", XXH64(colors.data(), colors.size() * sizeof(float), places));
}

}  // namespace raysplats
