// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/camera_list.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "io/byte_reader.hpp"
#include "io/dataset/data_origin.hpp"
#include "io/dataset/transforms.hpp"
#include "io/dataset/transforms_camera.hpp"
#include "io/json_file.hpp"
#include "io/text_reader.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "scene/camera/camera_check.hpp"
#include "scene/camera/photo_lens.hpp"

namespace raysplats::io {
namespace {

using Json = nlohmann::json;

std::optional<glm::dvec3> triple(const Json& json) {
  if (!json.is_array() || json.size() != 3) return std::nullopt;
  glm::dvec3 out;
  for (std::size_t k = 0; k < 3; ++k) {
    if (!json[k].is_number()) return std::nullopt;
    out[static_cast<int>(k)] = json[k].get<double>();
    if (!std::isfinite(out[static_cast<int>(k)])) return std::nullopt;
  }
  return out;
}

std::optional<int> side(const Json& view, const char* name) {
  const Json value = view.value(name, Json());
  if (!value.is_number_integer()) return std::nullopt;
  const auto pixels = value.get<std::int64_t>();
  if (pixels < 1 || pixels > kMaxSide) return std::nullopt;
  return static_cast<int>(pixels);
}

double focal(const Json& view, const char* name) {
  const Json value = view.value(name, Json());
  return value.is_number() ? value.get<double>() : 0.0;
}

/// World to camera, of the rows of camera to world; nothing for what is no rotation.
std::optional<glm::dmat3> rotation_of(const Json& rows) {
  if (!rows.is_array() || rows.size() != 3) return std::nullopt;
  glm::dmat3 out;  // whose columns they are
  for (std::size_t r = 0; r < 3; ++r) {
    const std::optional<glm::dvec3> row = triple(rows[r]);
    if (!row) return std::nullopt;
    out[static_cast<int>(r)] = *row;
  }
  if (!is_rotation(out)) return std::nullopt;
  return out;
}

/// Nothing for what is no view. Throws DataError for a lens that cannot be read.
std::optional<Camera> camera_of(const Json& view,
                                const std::filesystem::path& path,
                                std::size_t number) {
  if (!view.is_object()) return std::nullopt;
  const std::optional<glm::dvec3> center = triple(view.value("position", Json()));
  const std::optional<glm::dmat3> rotation = rotation_of(view.value("rotation", Json()));
  const std::optional<int> width = side(view, "width");
  const std::optional<int> height = side(view, "height");
  if (!center || !rotation || !width || !height) return std::nullopt;
  const std::string where = fmt::format("entry {}", number);
  TransformsFrame frame = stated_intrinsics(view, path, where);
  frame.number = number;
  frame.width = width;
  frame.height = height;
  frame.fx = focal(view, "fx");
  frame.fy = focal(view, "fy");
  if (!(*frame.fx > 0.0 && *frame.fy > 0.0)) {
    // Lists that name no models have panoramas without focal lengths.
    if (!view.contains("camera_model")) frame.model = CameraModel::kEquirectangular;
    if (frame.model != CameraModel::kEquirectangular) {
      throw DataError(fmt::format("{}, {}: its camera_model needs 'fx' and 'fy' above 0",
                                  path.string(), where));
    }
  }
  frame.rotation = *rotation;
  frame.translation = -(*rotation * *center);
  TransformsFile file;
  file.path = path;
  file.frames = {std::move(frame)};
  Camera camera = rendered_camera(frame_camera(file, 0, *width, *height));
  const Json name = view.value("img_name", Json());
  if (name.is_string()) camera.name = name.get<std::string>();
  return camera;
}

Json entries_of(const std::filesystem::path& path) {
  // The file is a list; the reader of bounded depth takes objects.
  const std::vector<std::byte> bytes = read_file(path);
  std::string_view list(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (list.starts_with(kByteOrderMark)) list.remove_prefix(kByteOrderMark.size());
  const std::string text = fmt::format("{{\"cameras\":{}}}", list);
  return parse_json_object(std::as_bytes(std::span(text)), path).at("cameras");
}

}  // namespace

std::vector<std::optional<Camera>> read_camera_list(const std::filesystem::path& path) {
  std::vector<std::optional<Camera>> out;
  for (const Json& view : entries_of(path)) {
    try {
      out.push_back(camera_of(view, path, out.size()));
    } catch (const DataError&) {
      out.push_back(std::nullopt);
    }
  }
  return out;
}

bool is_camera_list(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  char first = 0;
  for (const char byte : kByteOrderMark) {
    if (stream.peek() == static_cast<unsigned char>(byte)) stream.get();
  }
  return stream >> first && first == '[';
}

std::vector<Camera> read_listed_views(const std::filesystem::path& path) {
  std::vector<Camera> out;
  std::size_t without_lens = 0;
  for (const Json& view : entries_of(path)) {
    std::optional<Camera> camera = camera_of(view, path, out.size());
    if (!camera) {
      throw DataError(
          fmt::format("{}: entry {} is no view with position, rotation, width and height",
                      path.string(), out.size()));
    }
    if (camera->name.empty()) camera->name = fmt::format("frame_{:04d}", out.size());
    require_believable(*camera,
                       fmt::format("{}: the camera of entry {}", path.string(), out.size()));
    const bool named = view.contains("camera_model") || view.contains("cx");
    without_lens += !named && camera->model == CameraModel::kPinhole ? 1 : 0;
    out.push_back(std::move(*camera));
  }
  if (without_lens > 0) {
    spdlog::info(
        "{} names no lenses or principal points, as other programs and early runs write it: its "
        "cameras are taken for pinholes that look through the middle of their pictures; the data "
        "set knows theirs",
        path.string());
  }
  return out;
}

std::vector<Camera> read_model_cameras(const std::filesystem::path& path,
                                       const glm::dvec3& origin) {
  std::vector<Camera> out = read_cameras(path);
  if (is_camera_list(path)) return out;
  for (Camera& camera : out) move_origin(camera, origin);
  return out;
}

}  // namespace raysplats::io
