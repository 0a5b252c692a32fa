// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <glm/matrix.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "io/dataset/camera_list.hpp"
#include "io/dataset/camera_model_names.hpp"
#include "io/dataset/find_image.hpp"
#include "io/dataset/transforms.hpp"
#include "io/dataset/transforms_camera.hpp"
#include "io/image/image_file.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "scene/camera/camera_check.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/camera/photo_lens.hpp"
#include "util/atomic_file.hpp"
#include "util/json_text.hpp"

namespace raysplats {

std::vector<Camera> read_cameras(const std::filesystem::path& path) {
  if (io::is_camera_list(path)) {
    std::vector<Camera> views = io::read_listed_views(path);
    if (views.empty()) throw DataError(fmt::format("{} lists no cameras", path.string()));
    return views;
  }
  const io::TransformsFile file = io::read_transforms(path);
  if (file.frames.empty()) throw DataError(fmt::format("{} has no frames", path.string()));
  std::vector<Camera> cameras;
  for (std::size_t i = 0; i < file.frames.size(); ++i) {
    const io::TransformsFrame& frame = file.frames[i];
    io::ImageSize size{frame.width.value_or(0), frame.height.value_or(0)};
    if (!frame.width || !frame.height) {
      // Blender's files state no size, but the photos beside them have one.
      const auto image = frame.file_path.empty()
                             ? std::nullopt
                             : io::find_image(path.parent_path(), frame.file_path);
      if (!image) {
        throw DataError(
            fmt::format("{}: frame {} has no image size: add \"w\" and \"h\" to it or to the file",
                        path.string(), i));
      }
      size = io::image_size(*image);
      if (frame.width) size.width = *frame.width;
      if (frame.height) size.height = *frame.height;
    }
    cameras.push_back(rendered_camera(io::frame_camera(file, i, size.width, size.height)));
    cameras.back().name =
        frame.file_path.empty() ? fmt::format("frame_{:04d}", i) : io::inner_name(frame.file_path);
    require_believable(cameras.back(), fmt::format("{}: the camera of frame {}", path.string(), i));
  }
  return cameras;
}

void write_cameras(const std::filesystem::path& path, const std::vector<Camera>& written) {
  std::vector<Camera> cameras;
  cameras.reserve(written.size());
  for (const Camera& camera : written) {
    cameras.push_back(rendered_camera(camera));
    require_pixels(cameras.back());
  }
  const auto intrinsics = [](Camera camera) {
    if (camera.model == CameraModel::kEquirectangular) set_equirectangular(camera);
    nlohmann::json out = io::lens_keys(camera);
    out.update(
        {{"w", camera.width}, {"h", camera.height}, {"fl_x", camera.fx}, {"fl_y", camera.fy}});
    return out;
  };
  nlohmann::json root{{"frames", nlohmann::json::array()}};
  // Readers of instant-ngp's dialect know intrinsics of the file only.
  const bool shared = std::all_of(cameras.begin(), cameras.end(), [&](const Camera& camera) {
    return intrinsics(camera) == intrinsics(cameras.front());
  });
  const bool one_model = std::all_of(cameras.begin(), cameras.end(), [&](const Camera& camera) {
    return camera.model == cameras.front().model;
  });
  if (shared && !cameras.empty()) root.update(intrinsics(cameras.front()));
  // nerfstudio reads the model of the file only.
  if (!shared && one_model) root["camera_model"] = io::model_name(cameras.front().model);
  for (const Camera& camera : cameras) {
    nlohmann::json frame = shared ? nlohmann::json::object() : intrinsics(camera);
    const glm::dmat3 to_world = glm::transpose(camera.rotation);
    const glm::dvec3 center = camera.center();
    nlohmann::json matrix = nlohmann::json::array();
    for (int row = 0; row < 3; ++row) {
      matrix.push_back({to_world[0][row], -to_world[1][row], -to_world[2][row], center[row]});
    }
    matrix.push_back({0.0, 0.0, 0.0, 1.0});
    frame["file_path"] = camera.name;
    frame["transform_matrix"] = std::move(matrix);
    root["frames"].push_back(std::move(frame));
  }
  write_text_file(path, json_text(root, 1) + "\n");
}

}  // namespace raysplats
