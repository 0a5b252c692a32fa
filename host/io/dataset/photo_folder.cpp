// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/photo_folder.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "io/dataset/find_image.hpp"
#include "io/image/image_file.hpp"
#include "util/file_kind.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

/// What programs call the folder of their photos, the usual name first.
constexpr std::array<const char*, 8> kFolderNames{"images", "image", "photos", "rgb",
                                                  "color",  "input", "frames", "resized_images"};

/// Whether the folder has the photos of the model in the sizes of their cameras, all but
/// `most_missing`.
bool has_photos_of(const fs::path& folder,
                   const ColmapModel& model,
                   std::size_t most_missing,
                   RespeltFinder& respelt) {
  std::size_t missing = 0;
  return std::all_of(model.images.begin(), model.images.end(), [&](const ColmapImage& image) {
    const auto photo = find_photo(folder, image.name, respelt);
    if (!photo) return ++missing <= most_missing;
    const Camera& camera = model.cameras.at(image.camera_id);
    const ImageSize size = image_size(photo->path);
    const bool upright = size.width == camera.width && size.height == camera.height;
    return upright || (size.width == camera.height && size.height == camera.width);
  });
}

/// Whether the folder has any photo of the model.
bool has_photo_of(const fs::path& folder, const ColmapModel& model, RespeltFinder& respelt) {
  return std::any_of(model.images.begin(), model.images.end(), [&](const ColmapImage& image) {
    return find_photo(folder, image.name, respelt).has_value();
  });
}

/// Where the photos are if the usual folder has none of them: reduced copies may have other names
/// (NeRF-LLFF), and names of the model may begin with a folder of the root.
std::optional<fs::path> fuller_folder(const fs::path& root,
                                      const fs::path& usual,
                                      const ColmapModel& model,
                                      RespeltFinder& respelt) {
  if (usual == root || has_photo_of(usual, model, respelt)) return std::nullopt;
  for (const fs::path& folder : {root / "images", root}) {
    if (folder != usual && has_photo_of(folder, model, respelt)) return folder;
  }
  return std::nullopt;
}

/// A folder of another name that has the model's first photo, where that is not beside the model.
std::optional<fs::path> other_folder(const fs::path& root,
                                     const ColmapModel& model,
                                     RespeltFinder& respelt) {
  if (model.images.empty() || find_photo(root, model.images.front().name, respelt))
    return std::nullopt;
  for (const char* name : kFolderNames) {
    auto folder = respelt.find_folder(root, name);
    if (folder && find_photo(*folder, model.images.front().name, respelt)) return folder;
  }
  return std::nullopt;
}

std::size_t photos_in(const fs::path& folder, const ColmapModel& model, RespeltFinder& respelt) {
  const auto is_there = [&](const ColmapImage& image) {
    return find_photo(folder, image.name, respelt).has_value();
  };
  return static_cast<std::size_t>(
      std::count_if(model.images.begin(), model.images.end(), is_there));
}

/// Looks at the first photo: warns where it is not as much smaller than that in `images`, or than
/// its camera where there is none, as the name of its folder says.
void warn_of_size(const PhotoFolder& copies,
                  const fs::path& images,
                  const ColmapModel& model,
                  RespeltFinder& respelt) {
  constexpr double kMostOff = 0.1;
  for (const ColmapImage& image : model.images) {
    const auto photo = find_photo(copies.path, image.name, respelt);
    if (!photo) continue;
    const Camera& camera = model.cameras.at(image.camera_id);
    const auto whole = find_photo(images, image.name, respelt);
    const ImageSize size = image_size(photo->path);
    const ImageSize full = whole ? image_size(whole->path) : ImageSize{camera.width, camera.height};
    // Either may be turned by a quarter.
    const double factor =
        static_cast<double>(std::max(full.width, full.height)) / std::max(size.width, size.height);
    if (std::abs(factor / copies.factor - 1) <= kMostOff) return;
    spdlog::warn(
        "The photos in {} are {:.3g} times smaller than {} ({} x {} of {} x {} pixels, the first), "
        "not {} times as the name of their folder says",
        copies.path.string(), factor, whole ? "those in images" : "the cameras of the model",
        size.width, size.height, full.width, full.height, copies.factor);
    return;
  }
}

/// Reduced copies, or `images` in the place of those that lack photos which it has.
PhotoFolder fuller_copies(const PhotoFolder& copies,
                          const fs::path& images,
                          const ColmapModel& model,
                          RespeltFinder& respelt) {
  const std::size_t reduced = photos_in(copies.path, model, respelt);
  const std::size_t whole = photos_in(images, model, respelt);
  if (reduced >= whole) {
    warn_of_size(copies, images, model, respelt);
    return copies;
  }
  spdlog::warn("{} has {} of the {} photos of the model and {} has {}: those in images are used",
               copies.path.string(), reduced, model.images.size(), images.string(), whole);
  return {images, 1.0};
}

}  // namespace

std::optional<PhotoFolder> reduced_copies(const fs::path& root, double downscale) {
  const auto reduced = [&](int factor) { return root / fmt::format("images_{}", factor); };
  if (downscale > 1 && downscale <= 1024 && downscale == std::floor(downscale) &&
      is_folder(reduced(static_cast<int>(downscale)))) {
    return PhotoFolder{reduced(static_cast<int>(downscale)), downscale};
  }
  if (is_folder(root / "images")) return std::nullopt;
  std::optional<PhotoFolder> chosen;
  for (const int factor : {2, 4, 8}) {
    // The most reduced copy that is large enough, or else the largest copy.
    if (is_folder(reduced(factor)) && (!chosen || factor <= downscale)) {
      chosen = PhotoFolder{reduced(factor), static_cast<double>(factor)};
    }
  }
  return chosen;
}

std::optional<FoundPhoto> find_photo(const fs::path& folder,
                                     const fs::path& name,
                                     RespeltFinder& respelt) {
  for (const fs::path& candidate : {name, name.filename()}) {
    if (auto found = find_image(folder, candidate)) return FoundPhoto{*found};
    if (auto found = respelt.find(folder, candidate)) return FoundPhoto{*found, true};
    // Models of raw photos have extensions that no picture has.
    const fs::path any = fs::path(candidate).replace_extension(kImageExtensions.front());
    if (auto found = find_reformatted(folder, any)) return FoundPhoto{*found, false, true};
  }
  return std::nullopt;
}

PhotoFolder usual_photo_folder(const fs::path& root, double downscale) {
  const std::optional<PhotoFolder> chosen = reduced_copies(root, downscale);
  if (!chosen) {
    // Photos may be beside the model, for example when their names in the model include a folder.
    return {is_folder(root / "images") ? root / "images" : root, 1.0};
  }
  if (chosen->factor > downscale) {
    spdlog::info("{} has no folder images: {} is used at its own size, as with --downscale {}",
                 root.string(), chosen->path.filename().string(), chosen->factor);
  } else if (chosen->factor < downscale) {
    spdlog::info("{} has no folder images: {} is used", root.string(),
                 chosen->path.filename().string());
  }
  return *chosen;
}

PhotoFolder photo_folder(const fs::path& root, const ColmapModel& model, double downscale) {
  PhotoFolder usual = usual_photo_folder(root, downscale);
  const fs::path input = root / "input", images = root / "images";
  RespeltFinder respelt;
  // Reduced copies are of `images`. Photos that were deleted from it are left out.
  const bool has_usual = is_folder(images)
                             ? has_photos_of(images, model, model.images.size() / 2, respelt)
                             : usual.path != root;
  std::optional<fs::path> found;
  if (!has_usual && is_folder(input) && has_photos_of(input, model, 0, respelt)) found = input;
  if (!found && usual.path == root) found = other_folder(root, model, respelt);
  if (!found && (found = fuller_folder(root, usual.path, model, respelt))) {
    spdlog::info("{} has no photo of the names in the model: those in {} are used",
                 usual.path.string(), found->string());
    return {*found, 1.0};
  }
  if (!found) return usual.factor > 1 ? fuller_copies(usual, images, model, respelt) : usual;
  spdlog::info("the photos of the model are those in {}", found->string());
  return {*found, 1.0};
}

}  // namespace raysplats::io
