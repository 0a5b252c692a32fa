// SPDX-License-Identifier: Apache-2.0
#include "io/find_image.hpp"

#include <algorithm>
#include <cctype>
#include <functional>
#include <string>
#include <vector>

#include "io/image_file.hpp"
#include "util/file_kind.hpp"
#include "util/path_text.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

/// The single entry of a folder that is wanted; nothing when there is none or several.
std::optional<fs::path> only_entry(const fs::path& folder,
                                   const std::function<bool(const fs::path&)>& wanted) {
  std::optional<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (!wanted(entry->path())) continue;
    if (found) return std::nullopt;
    found = entry->path();
  }
  return found;
}

/// Whether two names differ in nothing but the case of A to Z.
bool same_but_case(std::string_view a, std::string_view b) {
  const auto small = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; };
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [&](char x, char y) { return small(x) == small(y); });
}

}  // namespace

std::optional<fs::path> find_image(const fs::path& folder, const fs::path& file_path) {
  const fs::path exact = (folder / file_path).lexically_normal();
  if (is_file(exact)) return exact;
  // Without an extension any will do; with one only its case may differ.
  const bool named = has_image_extension(exact);
  const std::string stem = named ? fs::path(exact).replace_extension().string() : exact.string();
  for (std::string extension : kImageExtensions) {
    if (named && lower_extension(exact) != extension) continue;
    if (is_file(stem + extension)) return stem + extension;
    for (char& c : extension) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    if (is_file(stem + extension)) return stem + extension;
  }
  return std::nullopt;
}

std::optional<fs::path> find_respelt(const fs::path& folder, const fs::path& file_path) {
  if (file_path.is_absolute()) return std::nullopt;
  const fs::path path = file_path.lexically_normal();
  fs::path place = folder;
  for (const fs::path& part : path.parent_path()) {
    const auto found = find_folder(place, part.string());
    if (!found) return std::nullopt;
    place = *found;
  }
  const std::string name = path.filename().string();
  const bool named = has_image_extension(path);
  return only_entry(place, [&](const fs::path& entry) {
    return same_but_case((named ? entry.filename() : entry.stem()).string(), name) &&
           has_image_extension(entry) && is_file(entry);
  });
}

std::optional<fs::path> find_moved(const fs::path& folder,
                                   const fs::path& file_path,
                                   std::size_t least_parts) {
  std::vector<fs::path> parts;
  for (const fs::path& part : file_path.lexically_normal().relative_path()) parts.push_back(part);
  for (std::size_t first = 1; first < parts.size() && parts.size() - first >= least_parts;
       ++first) {
    fs::path rest;
    for (std::size_t i = first; i < parts.size(); ++i) rest /= parts[i];
    if (auto found = find_image(folder, rest)) return found;
  }
  return least_parts > 1 ? std::nullopt : find_image(folder / "images", file_path.filename());
}

fs::path find_beside(const fs::path& folder, const fs::path& file_path, std::size_t least_parts) {
  if (is_file(folder / file_path)) return folder / file_path;
  return find_moved(folder, file_path, least_parts).value_or(folder / file_path);
}

std::optional<fs::path> find_folder(const fs::path& folder, std::string_view name) {
  if (is_folder(folder / name)) return folder / name;
  return only_entry(folder, [&](const fs::path& entry) {
    return same_but_case(entry.filename().string(), name) && is_folder(entry);
  });
}

}  // namespace raysplats::io
