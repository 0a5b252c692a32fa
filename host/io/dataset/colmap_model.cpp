// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/colmap_model.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <functional>
#include <glm/gtc/quaternion.hpp>
#include <iterator>
#include <map>
#include <span>
#include <sstream>
#include <string_view>
#include <utility>

#include "io/byte_reader.hpp"
#include "io/dataset/colmap_cameras.hpp"
#include "io/dataset/ply_points.hpp"
#include "io/text_reader.hpp"
#include "raysplats/error.hpp"
#include "util/file_kind.hpp"
#include "util/path_text.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxNameBytes = 4096;

using Fail = std::function<void(const std::string&)>;

ColmapImage make_image(std::string name,
                       std::uint64_t camera_id,
                       std::span<const double, 7> pose,
                       const Fail& fail) {
  for (const double value : pose) {
    if (!std::isfinite(value)) fail(fmt::format("the pose of image '{}' is not finite", name));
  }
  glm::dquat rotation(pose[0], pose[1], pose[2], pose[3]);
  if (glm::length(rotation) < 1e-6) fail(fmt::format("the rotation of image '{}' is zero", name));
  if (name.empty()) fail("an image has no name");
  if (camera_id > UINT32_MAX) fail(fmt::format("the camera number {} is too large", camera_id));
  ColmapImage image;
  image.name = portable_path(std::move(name)).string();
  image.camera_id = static_cast<std::uint32_t>(camera_id);
  image.rotation = glm::mat3_cast(glm::normalize(rotation));
  image.translation = {pose[4], pose[5], pose[6]};
  return image;
}

/// Whether the model takes the point: one that is not finite is nowhere.
bool add_point(ColmapModel& model, const glm::dvec3& position, std::span<const double, 3> rgb) {
  const glm::vec3 place(position);
  if (!std::isfinite(place.x) || !std::isfinite(place.y) || !std::isfinite(place.z)) return false;
  for (int i = 0; i < 3; ++i) {
    model.points.positions.push_back(place[i]);
    model.positions.push_back(position[i]);
  }
  for (const double value : rgb) {
    model.points.colors.push_back(static_cast<float>(std::clamp(value, 0.0, 255.0) / 255.0));
  }
  return true;
}

void read_images_binary(const fs::path& path, ColmapModel& model) {
  const auto bytes = read_file(path);
  ByteReader reader(bytes, path);
  const Fail fail = [&](const std::string& message) { reader.fail(message); };
  // Number, pose, camera, a name of one letter and the count of its points.
  const std::uint64_t count = reader.count("number of images", 4 + 7 * 8 + 4 + 2 + 8);
  model.images.reserve(static_cast<std::size_t>(count));
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto id = reader.read<std::uint32_t>("the image number");
    std::array<double, 7> pose;
    for (double& value : pose) value = reader.read<double>("the pose of an image");
    const auto camera = reader.read<std::uint32_t>("the camera of an image");
    std::string name = reader.zero_terminated("the name of an image", kMaxNameBytes);
    model.images.push_back(make_image(std::move(name), camera, pose, fail));
    model.images.back().id = id;
    constexpr std::uint64_t kPointBytes = 24;
    reader.skip(kPointBytes * reader.count("number of image points", kPointBytes),
                "the points of an image");
  }
}

/// Whether what is left of the line are points of an image, of which there may be none: x, y and a
/// whole number each. A line of an image has numbers in these places too, but ends with its name.
bool are_image_points(TextReader& reader) {
  std::size_t words = 0;
  for (std::string_view word = reader.word(); !word.empty(); word = reader.word()) {
    double number = 0;
    if (++words % 3 == 0 && !(parse_number(word, number) && number == std::floor(number)))
      return false;
  }
  return words % 3 == 0;
}

void read_images_text(const fs::path& path, ColmapModel& model) {
  const auto bytes = read_file(path);
  TextReader reader(bytes, path);
  const Fail fail = [&](const std::string& message) { reader.fail(message); };
  while (reader.next_content_line()) {
    const std::uint64_t id = reader.unsigned_integer("the image number");
    std::array<double, 7> pose;
    for (double& value : pose) value = reader.number("the pose of an image");
    const std::uint64_t camera = reader.unsigned_integer("the camera of an image");
    model.images.push_back(make_image(std::string(reader.rest()), camera, pose, fail));
    model.images.back().id = static_cast<std::uint32_t>(id);
    if (!reader.next_line()) return;
    if (!are_image_points(reader)) {
      reader.fail(
          fmt::format("the points of image '{}' (x, y, number), or an empty line, are missing: "
                      "found other text",
                      model.images.back().name));
    }
  }
}

/// Images that show a point: number of the image, place of the point.
using Tracks = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

/// Gives every image the points that it shows.
void share_tracks(const Tracks& tracks, ColmapModel& model) {
  std::map<std::uint32_t, ColmapImage*> by_id;
  for (ColmapImage& image : model.images) by_id.emplace(image.id, &image);
  for (const auto& [image, point] : tracks) {
    const auto found = by_id.find(image);
    if (found != by_id.end()) found->second->points.push_back(point);
  }
}

void add_track(PointCloud& points, std::uint64_t length, double error) {
  points.track_lengths.push_back(
      static_cast<std::uint32_t>(std::min<std::uint64_t>(length, 1u << 30)));
  points.errors.push_back(static_cast<float>(error));
}

void read_points_binary(const fs::path& path, ColmapModel& model) {
  const auto bytes = read_file(path);
  ByteReader reader(bytes, path);
  const std::uint64_t count = reader.count("number of points", 8 + 3 * 8 + 3 + 8 + 8);
  Tracks tracks;
  model.points.positions.reserve(3 * static_cast<std::size_t>(count));
  model.points.colors.reserve(3 * static_cast<std::size_t>(count));
  model.positions.reserve(3 * static_cast<std::size_t>(count));
  for (std::uint64_t i = 0; i < count; ++i) {
    reader.skip(8, "the number of a point");
    glm::dvec3 position;
    for (int axis = 0; axis < 3; ++axis)
      position[axis] = reader.read<double>("a point's coordinate");
    std::array<double, 3> rgb;
    for (double& value : rgb) value = reader.read<std::uint8_t>("a point's colour");
    const auto error = reader.read<double>("the error of a point");
    const std::uint64_t length = reader.count("track length", 8);
    if (!add_point(model, position, rgb)) {
      reader.skip(8 * length, "the track of a point");
      continue;
    }
    for (std::uint64_t k = 0; k < length; ++k) {
      tracks.emplace_back(reader.read<std::uint32_t>("the track of a point"),
                          static_cast<std::uint32_t>(model.points.size() - 1));
      reader.skip(4, "the track of a point");
    }
    add_track(model.points, length, error);
  }
  warn_of_points(path, static_cast<std::size_t>(count) - model.points.size(), count);
  share_tracks(tracks, model);
}

void read_points_text(const fs::path& path, ColmapModel& model) {
  const auto bytes = read_file(path);
  TextReader reader(bytes, path);
  Tracks tracks;
  std::size_t left_out = 0;
  while (reader.next_content_line()) {
    reader.unsigned_integer("the number of a point");
    glm::dvec3 position;
    for (int axis = 0; axis < 3; ++axis) position[axis] = reader.number("a point's coordinate");
    std::array<double, 3> rgb;
    for (double& value : rgb)
      value = static_cast<double>(reader.unsigned_integer("a point's colour"));
    const double error = reader.number("the error of a point");
    if (!add_point(model, position, rgb)) {
      ++left_out;
      continue;
    }
    std::istringstream track{std::string(reader.rest())};
    const std::vector<std::string> words{std::istream_iterator<std::string>(track), {}};
    for (std::size_t k = 0; k + 1 < words.size(); k += 2) {
      std::uint32_t image = 0;
      const char* end = words[k].data() + words[k].size();
      // Numbers that are none name no image.
      if (std::from_chars(words[k].data(), end, image).ptr == end)
        tracks.emplace_back(image, static_cast<std::uint32_t>(model.points.size() - 1));
    }
    add_track(model.points, words.size() / 2, error);
  }
  warn_of_points(path, left_out, left_out + model.points.size());
  share_tracks(tracks, model);
}

/// The binary file of `stem`, else the text file, else nothing.
std::optional<fs::path> model_file(const fs::path& folder, const char* stem) {
  for (const char* extension : {".bin", ".txt"}) {
    const fs::path path = folder / (std::string(stem) + extension);
    std::error_code error;
    if (fs::is_regular_file(path, error)) return path;
  }
  return std::nullopt;
}

bool is_binary(const fs::path& path) { return path.extension() == ".bin"; }

/// The images of a folder's model, sorted by name, and their cameras.
ColmapModel read_poses(const fs::path& folder) {
  const std::optional<fs::path> cameras = model_file(folder, "cameras");
  const std::optional<fs::path> images = model_file(folder, "images");
  if (!cameras || !images) {
    throw DataError(fmt::format(
        "{} is no COLMAP model: cameras or images (.bin or .txt) are missing", folder.string()));
  }
  ColmapModel model;
  is_binary(*images) ? read_images_binary(*images, model) : read_images_text(*images, model);
  is_binary(*cameras) ? read_cameras_binary(*cameras, model) : read_cameras_text(*cameras, model);
  for (const ColmapImage& image : model.images) {
    if (!model.cameras.contains(image.camera_id)) {
      throw DataError(fmt::format("{}: the image '{}' uses the camera {}, which {} does not have",
                                  images->string(), image.name, image.camera_id,
                                  cameras->string()));
    }
  }
  std::sort(model.images.begin(), model.images.end(),
            [](const ColmapImage& a, const ColmapImage& b) { return a.name < b.name; });
  const auto twice = std::adjacent_find(
      model.images.begin(), model.images.end(),
      [](const ColmapImage& a, const ColmapImage& b) { return a.name == b.name; });
  if (twice != model.images.end()) {
    throw DataError(fmt::format("{}: the image '{}' appears twice", images->string(), twice->name));
  }
  return model;
}

/// The folder whose model has most images, the first of several. Those that cannot be read are left
/// out with a warning where another can. Throws the first one's DataError where none can.
fs::path largest_model(const std::vector<fs::path>& folders) {
  std::optional<fs::path> best;
  std::size_t most = 0;
  std::vector<std::string> errors;
  for (const fs::path& folder : folders) {
    try {
      const std::size_t images = read_poses(folder).images.size();
      if (best && images <= most) continue;
      best = folder;
      most = images;
    } catch (const DataError& error) {
      errors.emplace_back(error.what());
    }
  }
  if (!best) throw DataError(errors.front());
  for (const std::string& error : errors)
    spdlog::warn("One of the COLMAP models cannot be read and is not used: {}", error);
  spdlog::info("Of {} COLMAP models {} is used: it has most images ({})", folders.size(),
               best->string(), most);
  return *best;
}

}  // namespace

std::optional<fs::path> find_colmap_model(const fs::path& root) {
  std::vector<fs::path> candidates;
  const auto add = [&](const fs::path& folder) {
    if (model_file(folder, "cameras") && model_file(folder, "images")) candidates.push_back(folder);
  };
  const auto add_children = [&](const fs::path& parent) {
    std::vector<fs::path> children;
    std::error_code error;
    for (fs::directory_iterator entry(parent, error), end; !error && entry != end;
         entry.increment(error)) {
      if (entry->is_directory(error)) children.push_back(entry->path());
    }
    std::sort(children.begin(), children.end());
    for (const fs::path& child : children) add(child);
    add(parent);
  };
  add_children(root / "sparse");
  add_children(root / "colmap" / "sparse");
  add(root / "colmap");
  add(root);
  // What 3DGS's convert.py leaves before it undistorts.
  if (candidates.empty()) add_children(root / "distorted" / "sparse");
  if (candidates.size() <= 1) {
    return candidates.empty() ? std::nullopt : std::optional(candidates.front());
  }
  return largest_model(candidates);
}

ColmapModel read_colmap_model(const fs::path& folder) {
  ColmapModel model = read_poses(folder);
  if (const std::optional<fs::path> points = model_file(folder, "points3D")) {
    is_binary(*points) ? read_points_binary(*points, model) : read_points_text(*points, model);
  } else if (const fs::path ply = folder / "points3D.ply"; is_file(ply)) {
    PlyPoints read = read_ply_points(ply);
    model.points = std::move(read.cloud);
    model.positions = std::move(read.positions);
    spdlog::info("{} points are those of {}", model.points.size(), ply.string());
  } else {
    spdlog::warn("{} has no points3D.bin, .txt or .ply: the data set has no points to start from",
                 folder.string());
  }
  return model;
}

}  // namespace raysplats::io
