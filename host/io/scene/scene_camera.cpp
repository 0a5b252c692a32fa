// SPDX-License-Identifier: Apache-2.0
#include "io/scene/scene_camera.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "io/dataset/camera_list.hpp"
#include "io/dataset/data_origin.hpp"
#include "io/dataset/dataset_views.hpp"
#include "io/toml_table.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "scene/camera/camera_check.hpp"
#include "scene/camera/camera_model.hpp"

namespace raysplats {
namespace {

using Source = SceneCamera::Source;

constexpr int kSide = 800;
constexpr double kFov = 45.0;
constexpr double kHuge = 1e30;
constexpr double kMaxFrames = 1e6;

bool is_wide(CameraModel model) { return model == CameraModel::kFisheye; }

void read_lens(io::TomlTable& table, SceneCamera& camera) {
  table.choice<CameraModel>("model", camera.model,
                            {{"pinhole", CameraModel::kPinhole},
                             {"opencv", CameraModel::kOpenCv},
                             {"fisheye", CameraModel::kFisheye},
                             {"equirectangular", CameraModel::kEquirectangular},
                             {"orthographic", CameraModel::kOrthographic}});
  if (camera.model == CameraModel::kOrthographic) {
    camera.extent = table.number("extent", 1e-9, kHuge);
  } else if (camera.model != CameraModel::kEquirectangular) {
    camera.fov = table.number("fov", kLeastFov, most_fov(camera.model));
    camera.focal = table.number("focal", 1e-3, 1e9);
    if (camera.fov && camera.focal) {
      table.fail("focal", "'fov' and 'focal' in [camera] say the same: leave one out");
    }
  }
  if (camera.model != CameraModel::kEquirectangular) {
    if (const auto point = table.numbers("principal-point", 2)) {
      camera.principal_point = glm::dvec2((*point)[0], (*point)[1]);
    }
  }
  const bool brown = camera.model == CameraModel::kOpenCv;
  const bool parallel = camera.model == CameraModel::kOrthographic;
  const bool around = camera.model == CameraModel::kEquirectangular;
  table.only_for("extent", parallel, "model = \"orthographic\"");
  for (const char* key : {"fov", "focal"})
    table.only_for(key, !parallel && !around, "the models pinhole, opencv and fisheye");
  table.only_for("principal-point", !around, "every model but equirectangular");
  for (const char* key : {"k1", "k2", "k3"})
    table.only_for(key, brown || is_wide(camera.model), "the models opencv and fisheye");
  for (const char* key : {"p1", "p2"}) table.only_for(key, brown, "model = \"opencv\"");
  table.only_for("k4", is_wide(camera.model), "model = \"fisheye\"");
  if (!brown && !is_wide(camera.model)) return;
  Distortion& d = camera.distortion;
  for (const auto& [key, target] :
       {std::pair{"k1", &d.k1}, std::pair{"k2", &d.k2}, std::pair{"k3", &d.k3}}) {
    table.number(key, *target, -100.0, 100.0);
  }
  if (brown) {
    table.number("p1", d.p1, -100.0, 100.0);
    table.number("p2", d.p2, -100.0, 100.0);
  } else {
    table.number("k4", d.k4, -100.0, 100.0);
  }
}

void read_orbit(io::TomlTable table, SceneCamera& camera) {
  if (table.has("frames")) table.number("frames", camera.frames.emplace(), 1, kMaxFrames);
  camera.elevation = table.number("elevation", -89.9, 89.9);
  camera.distance = table.number("distance", 1e-9, kHuge);
  camera.target = table.vector("target");
  table.finish();
}

// A key of [camera] that is an option of data sets.
void read_data_row(io::TomlTable& table, const char* key, SceneCamera& camera) {
  table.option(
      key, [&](const std::vector<std::string>& values) { camera.data_settings.set(key, values); });
}

void read_views(io::TomlTable& table, SceneCamera& camera) {
  read_data_row(table, "downscale", camera);
  const auto views = table.numbers("views", 0);
  if (!views) return;
  for (const double view : *views) {
    if (view < 0 || view != std::floor(view) || view > kMaxFrames) {
      table.fail("views",
                 fmt::format("'views' in [camera] are numbers of views from 0 on, not {:g}", view));
    }
    camera.views.push_back(static_cast<std::size_t>(view));
  }
}

void set_lens(Camera& out, const SceneCamera& camera) {
  out.model = camera.model;
  out.distortion = camera.distortion;
  const double half = 0.5 * std::min(out.width, out.height);
  const double half_angle = 0.5 * camera.fov.value_or(kFov) * std::numbers::pi / 180.0;
  switch (camera.model) {
    case CameraModel::kPinhole:
      out.fx = half / std::tan(half_angle);
      break;
    case CameraModel::kOpenCv:
    case CameraModel::kFisheye: {
      const double r = is_wide(camera.model) ? half_angle : std::tan(half_angle);
      if (!camera.focal && r > lens_limit(camera.model, camera.distortion)) {
        throw UsageError(fmt::format(
            "{}: the lens of [camera] does not reach a field of view of {:g} degrees, because its "
            "distortion folds back before: give a smaller 'fov', or 'focal'",
            camera.place, camera.fov.value_or(kFov)));
      }
      out.fx = half / radial_image(camera.model, camera.distortion, r);
      break;
    }
    case CameraModel::kOrthographic:
      out.fx = 2.0 * half / camera.extent.value_or(1.0);
      break;
    case CameraModel::kEquirectangular:
      out.fx = out.width / (2.0 * std::numbers::pi);
      break;
    case CameraModel::kPhotoLens:
      break;  // has no name in scene files
  }
  if (camera.focal) out.fx = *camera.focal;
  out.fy = out.fx;
  if (camera.principal_point) {
    out.cx = camera.principal_point->x;
    out.cy = camera.principal_point->y;
  }
}

/// Square, but a panorama is twice as wide as high.
int default_height(const SceneCamera& camera, int width) {
  return camera.model == CameraModel::kEquirectangular ? std::max(1, width / 2) : kSide;
}

std::vector<Camera> placed(const SceneCamera& camera) {
  const glm::dvec3 eye = camera.position.value_or(glm::dvec3(0.0));
  const glm::dvec3 target = camera.target.value_or(glm::dvec3(0.0));
  const glm::dvec3 up = camera.up.value_or(glm::dvec3(0.0, -1.0, 0.0));
  const int width = camera.width.value_or(kSide);
  const int height = camera.height.value_or(default_height(camera, width));
  Camera out = look_at(eye, target, glm::normalize(up), width, height, 1.0);
  set_lens(out, camera);
  return {out};
}

std::vector<Camera> chosen(const SceneCamera& camera, std::vector<Camera> cameras) {
  if (cameras.empty()) {
    throw DataError(
        fmt::format("{}: {} has no views of the chosen split", camera.place, camera.file.string()));
  }
  if (!camera.views.empty()) {
    std::vector<Camera> some;
    for (const std::size_t view : camera.views) {
      if (view >= cameras.size()) {
        throw UsageError(fmt::format("{}: there is no view {} among the {} of {}", camera.place,
                                     view, cameras.size(), camera.file.string()));
      }
      some.push_back(cameras[view]);
    }
    cameras = std::move(some);
  }
  return cameras;
}

glm::dvec3 origin_of(const DatasetOptions& trained) {
  const std::array<double, 3> origin = trained.origin.value_or(std::array<double, 3>{});
  return {origin[0], origin[1], origin[2]};
}

std::vector<Camera> on_orbit(const SceneCamera& camera,
                             const SceneExtent& extent,
                             int frames,
                             const DatasetOptions& trained) {
  SceneExtent around = extent;
  if (camera.target) around.center = *camera.target;
  OrbitOptions shape;
  shape.frames = camera.frames.value_or(frames);
  if (!camera.file.empty()) {
    DatasetOptions options = camera.data_settings.over(trained);
    options.test_list.reset();  // all count, also of other data than the run's
    const std::vector<Camera> photos = cameras_of(load_dataset(camera.file, options), Split::kAll);
    if (!camera.target) around.center = common_target(photos).value_or(extent.center);
    shape.up = camera.up.value_or(estimate_up(photos));
    shape = orbit_like(photos, around.center, shape);
    shape.width = photos.front().width;
    shape.height = photos.front().height;
    shape.fov_degrees = field_of_view(photos.front(), camera.model);
  }
  if (camera.up) shape.up = *camera.up;
  if (camera.width) shape.width = *camera.width;
  if (camera.file.empty() || camera.model == CameraModel::kEquirectangular)
    shape.height = default_height(camera, shape.width);
  if (camera.height) shape.height = *camera.height;
  if (camera.elevation) shape.elevation_degrees = *camera.elevation;
  if (camera.distance) shape.distance = *camera.distance;
  // The angle places the eye where no distance is given; beyond a pinhole's it would be inside.
  SceneCamera lens = camera;
  lens.fov = camera.fov.value_or(shape.fov_degrees);
  if (camera.focal) {
    lens.fov = 2.0 * std::atan(0.5 * std::min(shape.width, shape.height) / *camera.focal) * 180.0 /
               std::numbers::pi;
  }
  shape.fov_degrees = std::clamp(*lens.fov, kLeastFov, 90.0);
  if (camera.model == CameraModel::kOrthographic && !lens.extent) lens.extent = 2.0 * around.radius;
  std::vector<Camera> cameras = orbit_cameras(around, shape);
  for (Camera& each : cameras) set_lens(each, lens);
  return cameras;
}

/// The views of a data set.
void read_data_views(io::TomlTable& table, SceneCamera& camera) {
  camera.source = Source::kData;
  read_views(table, camera);
  table.choice<Split>("split", camera.split,
                      {{"test", Split::kTest}, {"train", Split::kTrain}, {"all", Split::kAll}});
  read_data_row(table, "test-every", camera);
  if (const auto list = table.existing("test-list")) {
    if (camera.data_settings.has("test-every")) {
      table.fail("test-list",
                 "'test-every' and 'test-list' in [camera] contradict each other: leave one out");
    }
    camera.data_settings.set("test-list", {list->string()});
  }
  read_data_row(table, "undistort", camera);
}

/// A camera at a position.
void read_placed(io::TomlTable& table, SceneCamera& camera) {
  camera.source = Source::kPlaced;
  camera.target = table.vector("target");
  if (!camera.target) table.fail("position", "[camera] has a 'position' but no 'target'");
  if (*camera.target == *camera.position) {
    table.fail("target", "'position' and 'target' in [camera] are the same point");
  }
  if (camera.model == CameraModel::kOrthographic && !camera.extent) {
    table.fail("model",
               "an orthographic [camera] needs 'extent', the world units along the picture's "
               "smaller side");
  }
}

/// A camera of the file's own: its picture, its lens, and where it stands or goes.
void read_own_camera(io::TomlTable& table, SceneCamera& camera) {
  camera.up = table.direction("up");
  for (auto [key, side] :
       {std::pair{"width", &camera.width}, std::pair{"height", &camera.height}}) {
    int value = 0;
    table.number(key, value, 1, kMaxSide);
    if (value > 0) *side = value;
  }
  read_lens(table, camera);
  if (table.has("orbit")) {
    camera.source = Source::kOrbit;
    read_orbit(*table.table("orbit"), camera);
  } else {
    read_placed(table, camera);
  }
}

/// Refuses keys that the camera's source does not read. `own`: of this file, not of another.
void refuse_idle_keys(io::TomlTable& table, const SceneCamera& camera, bool own) {
  const bool views = camera.source == Source::kData, file = camera.source == Source::kFile;
  for (const char* key : {"split", "test-every", "test-list", "undistort"})
    table.only_for(key, views, "the views of 'data'");
  table.only_for("views", views || file, "'file' and the views of 'data'");
  table.only_for("downscale", !camera.file.empty(), "'file' and 'data'");
  for (const char* key : {"up", "width", "height", "model", "fov", "focal", "extent",
                          "principal-point", "k1", "k2", "k3", "k4", "p1", "p2"}) {
    table.only_for(key, own, "'position' and 'orbit'");
  }
  table.only_for("target", camera.position.has_value(), "'position': an orbit has orbit.target");
}

}  // namespace

SceneCamera read_scene_camera(io::TomlTable& table) {
  SceneCamera camera;
  camera.place = table.place();
  camera.position = table.vector("position");
  const auto file = table.existing("file");
  const auto data = table.existing("data");
  const bool orbit = table.has("orbit");
  const int sources = (camera.position ? 1 : 0) + (file ? 1 : 0) + (data || orbit ? 1 : 0);
  if (sources != 1) {
    table.fail("",
               "[camera] has to be one of 'position' with 'target', 'file', 'data' and 'orbit' "
               "('data' goes with 'orbit')");
  }
  camera.file = file ? *file : data.value_or(std::filesystem::path());
  if (file) {
    camera.source = Source::kFile;
    read_views(table, camera);
  } else if (data && !orbit) {
    read_data_views(table, camera);
  } else {
    if (data) read_data_row(table, "downscale", camera);
    read_own_camera(table, camera);
  }
  refuse_idle_keys(table, camera, camera.position || orbit);
  table.finish();
  return camera;
}

std::vector<Camera> scene_cameras(const SceneCamera& camera,
                                  const SceneExtent& extent,
                                  int frames,
                                  const DatasetOptions& trained) {
  switch (camera.source) {
    case Source::kPlaced:
      return placed(camera);
    case Source::kFile: {
      std::vector<Camera> cameras =
          chosen(camera, io::read_model_cameras(camera.file, origin_of(trained)));
      const double factor = camera.data_settings.over({}).factor();
      for (Camera& each : cameras) each = downscaled(each, factor);
      return cameras;
    }
    case Source::kData:
      return chosen(
          camera,
          cameras_of(load_dataset(camera.file, camera.data_settings.over(trained)), camera.split));
    case Source::kGiven: {
      std::vector<Camera> cameras = camera.given;
      for (Camera& each : cameras) io::move_origin(each, origin_of(trained));
      return cameras;
    }
    case Source::kOrbit:
      return on_orbit(camera, extent, frames, trained);
    case Source::kNone:
      break;
  }
  throw UsageError(
      fmt::format("{} has no camera: add a table [camera], or give --orbit N, --cameras FILE or "
                  "--data DATASET",
                  camera.place));
}

Camera resized(const Camera& camera, std::optional<int> width, std::optional<int> height) {
  Camera out = camera;
  const auto matching = [](int side, int from, int to) {
    return std::max(1, static_cast<int>(std::lround(static_cast<double>(side) * to / from)));
  };
  if (!width && !height) return out;
  out.width = width ? *width : matching(camera.width, camera.height, *height);
  out.height = height ? *height : matching(camera.height, camera.width, *width);
  const double scale =
      static_cast<double>(std::min(out.width, out.height)) / std::min(camera.width, camera.height);
  out.fx *= scale;
  out.fy *= scale;
  out.cx *= static_cast<double>(out.width) / camera.width;
  out.cy *= static_cast<double>(out.height) / camera.height;
  return out;
}

}  // namespace raysplats
