// SPDX-License-Identifier: Apache-2.0
#include "io/photo_folder.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "io/find_image.hpp"
#include "io/image_file.hpp"
#include "util/file_kind.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

/// What programs call the folder of their photos, the usual name first.
constexpr std::array<const char*, 8> kFolderNames{"images", "image", "photos", "rgb",
                                                  "color",  "input", "frames", "resized_images"};

/// Whether the folder has every photo of the model in the size of its camera.
bool has_photos_of(const fs::path& folder, const ColmapModel& model) {
  return std::all_of(model.images.begin(), model.images.end(), [&](const ColmapImage& image) {
    const auto photo = find_photo(folder, image.name);
    if (!photo) return false;
    const Camera& camera = model.cameras.at(image.camera_id);
    const ImageSize size = image_size(*photo);
    const bool upright = size.width == camera.width && size.height == camera.height;
    return upright || (size.width == camera.height && size.height == camera.width);
  });
}

/// Whether the folder has any photo of the model.
bool has_photo_of(const fs::path& folder, const ColmapModel& model) {
  const auto is_there = [&](const ColmapImage& image) {
    return find_photo(folder, image.name).has_value();
  };
  return std::any_of(model.images.begin(), model.images.end(), is_there) ||
         (!model.images.empty() && find_respelt(folder, model.images.front().name));
}

/// Where the photos are if the usual folder has none of them: reduced copies may have other names
/// (NeRF-LLFF), and names of the model may begin with a folder of the root.
std::optional<fs::path> fuller_folder(const fs::path& root,
                                      const fs::path& usual,
                                      const ColmapModel& model) {
  if (usual == root || has_photo_of(usual, model)) return std::nullopt;
  for (const fs::path& folder : {root / "images", root}) {
    if (folder != usual && has_photo_of(folder, model)) return folder;
  }
  return std::nullopt;
}

/// A folder of another name that has the model's first photo, where that is not beside the model.
std::optional<fs::path> other_folder(const fs::path& root, const ColmapModel& model) {
  if (model.images.empty() || find_photo(root, model.images.front().name)) return std::nullopt;
  for (const char* name : kFolderNames) {
    auto folder = find_folder(root, name);
    if (folder && find_photo(*folder, model.images.front().name)) return folder;
  }
  return std::nullopt;
}

}  // namespace

std::optional<fs::path> find_photo(const fs::path& folder, const fs::path& name) {
  for (const fs::path& candidate : {name, name.filename()}) {
    if (is_file(folder / candidate)) return folder / candidate;
    fs::path stem = candidate;
    stem.replace_extension();
    if (auto found = find_image(folder, stem)) return found;
  }
  return std::nullopt;
}

PhotoFolder usual_photo_folder(const fs::path& root, double downscale) {
  const auto reduced = [&](int factor) { return root / fmt::format("images_{}", factor); };
  if (downscale > 1 && downscale <= 1024 && downscale == std::floor(downscale) &&
      is_folder(reduced(static_cast<int>(downscale)))) {
    return {reduced(static_cast<int>(downscale)), downscale};
  }
  if (is_folder(root / "images")) return {root / "images", 1.0};
  std::optional<PhotoFolder> chosen;
  for (const int factor : {2, 4, 8}) {
    // The most reduced copy that is large enough, or else the largest copy.
    if (is_folder(reduced(factor)) && (!chosen || factor <= downscale)) {
      chosen = PhotoFolder{reduced(factor), static_cast<double>(factor)};
    }
  }
  if (!chosen) {
    // Photos beside the model, for example when their names in the model include a folder.
    return {root, 1.0};
  }
  if (chosen->factor > downscale) {
    spdlog::info("{} has no folder images: {} is used at its own size, as with --downscale {}",
                 root.string(), chosen->path.filename().string(), chosen->factor);
  } else {
    spdlog::info("{} has no folder images: {} is used", root.string(),
                 chosen->path.filename().string());
  }
  return *chosen;
}

PhotoFolder photo_folder(const fs::path& root, const ColmapModel& model, double downscale) {
  PhotoFolder usual = usual_photo_folder(root, downscale);
  const fs::path input = root / "input", images = root / "images";
  // Reduced copies are of `images`.
  const bool has_usual = is_folder(images) ? has_photos_of(images, model) : usual.path != root;
  std::optional<fs::path> found;
  if (!has_usual && is_folder(input) && has_photos_of(input, model)) found = input;
  if (!found && usual.path == root) found = other_folder(root, model);
  if (!found && (found = fuller_folder(root, usual.path, model))) {
    spdlog::info("{} has no photo of the names in the model: those in {} are used",
                 usual.path.string(), found->string());
    return {*found, 1.0};
  }
  if (!found) return usual;
  spdlog::info("the photos of the model are those in {}", found->string());
  return {*found, 1.0};
}

}  // namespace raysplats::io
