// SPDX-License-Identifier: Apache-2.0
#include "io/photo_folder.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "io/image_file.hpp"
#include "io/transforms.hpp"
#include "util/file_kind.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

PhotoFolder choose_photo_folder(const fs::path& root, double downscale) {
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

PhotoFolder photo_folder(const fs::path& root, const ColmapModel& model, double downscale) {
  PhotoFolder usual = choose_photo_folder(root, downscale);
  const fs::path input = root / "input", images = root / "images";
  if (!is_folder(input)) return usual;
  // Reduced copies are of `images`.
  if (is_folder(images) ? has_photos_of(images, model) : usual.path != root) return usual;
  if (!has_photos_of(input, model)) return usual;
  spdlog::info("the photos of the model are those in {}", input.string());
  return {input, 1.0};
}

}  // namespace raysplats::io
