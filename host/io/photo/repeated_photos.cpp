// SPDX-License-Identifier: Apache-2.0
#include "io/photo/repeated_photos.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "io/file_hash.hpp"
#include "util/number_text.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

fs::path name_of(const View& view) { return view.image_path.lexically_normal(); }

/// The bytes of a photo's file; nothing where there is no file, or so few for the pixels that they
/// show nothing: clear sky, or black, is the same from anywhere, and no copy.
std::optional<std::uintmax_t> telling_size(const fs::path& file, double pixels) {
  constexpr double kHead = 1024;          // of any file
  constexpr double kBytesOfPixel = 0.03;  // of a JPEG of one colour, the largest of such files
  std::error_code error;
  const std::uintmax_t bytes = fs::file_size(file, error);
  if (error || static_cast<double>(bytes) < kHead + kBytesOfPixel * pixels) return std::nullopt;
  return bytes;
}

using Groups = std::vector<std::vector<fs::path>>;

/// The groups of files of the same group that have the same key; files without any, or that nothing
/// shares its key with, are left out.
template <class KeyOf>
Groups parted(const Groups& groups, const KeyOf& key_of) {
  Groups out;
  for (const std::vector<fs::path>& group : groups) {
    std::map<typename decltype(key_of(group.front()))::value_type, std::vector<fs::path>> parts;
    for (const fs::path& file : group) {
      if (const auto key = key_of(file)) parts[*key].push_back(file);
    }
    for (auto& [key, part] : parts) {
      if (part.size() > 1) out.push_back(std::move(part));
    }
  }
  return out;
}

/// Which photos are the same, whatever their names.
class Photos {
 public:
  explicit Photos(std::span<const View> views) {
    std::map<fs::path, double> pixels;
    for (const View& view : views) {
      const Camera& camera = view.source_camera;
      pixels.emplace(name_of(view), static_cast<double>(camera.width) * camera.height);
    }
    std::vector<fs::path> names;
    names.reserve(pixels.size());
    for (const auto& [name, count] : pixels) names.push_back(name);
    // Files that are not compressed all have one size. What is not the same mostly differs in the
    // middle already, where no picture has its head, its margins or the bars of a video.
    constexpr std::uintmax_t kMiddle = 65536;
    std::map<fs::path, std::uintmax_t> sizes;
    Groups groups = parted({names}, [&](const fs::path& file) {
      const std::optional<std::uintmax_t> size = telling_size(file, pixels.at(file));
      if (size) sizes.emplace(file, *size);
      return size;
    });
    groups = parted(groups, [&](const fs::path& file) {
      return file_hash(file, (sizes.at(file) - std::min(sizes.at(file), kMiddle)) / 2, kMiddle);
    });
    groups = parted(groups, [](const fs::path& file) { return file_hash(file); });
    for (const std::vector<fs::path>& group : groups) {
      for (const fs::path& file : group) originals_.emplace(file, group.front());
    }
  }

  /// The name that stands for all copies of a view's photo.
  fs::path original(const View& view) const {
    const fs::path name = name_of(view);
    const auto found = originals_.find(name);
    return found == originals_.end() ? name : found->second;
  }

 private:
  std::map<fs::path, fs::path> originals_;  // of all that have a copy
};

/// The photos of one side of the split by their originals, with the name of the first copy there.
std::map<fs::path, fs::path> names_of(std::span<const View> views,
                                      bool test,
                                      const Photos& photos) {
  std::map<fs::path, fs::path> names;
  for (const View& view : views) {
    if (view.test == test) names.emplace(photos.original(view), name_of(view));
  }
  return names;
}

std::string both_names(const fs::path& name, const fs::path& other) {
  return name == other ? name.string()
                       : fmt::format("{} under the name {}", name.string(), other.string());
}

void part_held_out(std::vector<View>& views, const Photos& photos) {
  const std::map<fs::path, fs::path> held_out = names_of(views, true, photos);
  const std::map<fs::path, fs::path> trained = names_of(views, false, photos);
  std::vector<fs::path> shared;
  for (const auto& [original, name] : trained) {
    if (held_out.contains(original)) shared.push_back(original);
  }
  if (shared.empty()) return;
  const fs::path &here = trained.at(shared.front()), &there = held_out.at(shared.front());
  if (2 * shared.size() > trained.size()) {
    spdlog::warn(
        "{} of {} held-out photos are trained on as well, {} among them, as few would be left to "
        "train on without them: their PSNR says nothing of unseen views",
        shared.size(), held_out.size(), both_names(there, here));
    return;
  }
  spdlog::warn(
      "{} of {} photos to train on are held out too, {} among them: they are not trained on",
      shared.size(), trained.size(), both_names(here, there));
  std::erase_if(views, [&](const View& view) {
    return !view.test && held_out.contains(photos.original(view));
  });
}

void warn_of_repeated_photos(std::span<const View> views, const Photos& photos) {
  std::map<std::pair<fs::path, bool>, fs::path> seen;
  std::map<fs::path, std::string> repeated;
  for (const View& view : views) {
    const fs::path original = photos.original(view), name = name_of(view);
    const auto [first, is_new] = seen.try_emplace({original, view.test}, name);
    if (!is_new) repeated.emplace(original, both_names(first->second, name));
  }
  if (repeated.empty()) return;
  spdlog::warn("{} in more than one frame, {} the first",
               counted(static_cast<double>(repeated.size()), "photo is", "photos are"),
               repeated.begin()->second);
}

}  // namespace

void settle_repeated_photos(std::vector<View>& views) {
  const Photos photos(views);
  part_held_out(views, photos);
  warn_of_repeated_photos(views, photos);
}

}  // namespace raysplats::io
