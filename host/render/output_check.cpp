// SPDX-License-Identifier: Apache-2.0
#include "render/output_check.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>
#include <system_error>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

bool same(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code error;
  return std::filesystem::equivalent(a, b, error) && !error;
}

[[noreturn]] void refuse(const std::filesystem::path& output, const std::filesystem::path& data) {
  throw UsageError(
      fmt::format("The output folder {} belongs to the data set {}: choose another with -o",
                  output.string(), data.string()));
}

}  // namespace

void check_not_data(const std::filesystem::path& output, const Dataset& dataset) {
  if (same(output, dataset.root)) refuse(output, dataset.root);
  std::set<std::filesystem::path> folders;
  for (const View& view : dataset.views) folders.insert(view.image_path.parent_path());
  for (const std::filesystem::path& folder : folders) {
    if (same(output, folder)) refuse(output, dataset.root);
  }
}

void check_not_data(const std::filesystem::path& output, const std::filesystem::path& data) {
  std::error_code error;
  std::filesystem::path root = data;
  if (!std::filesystem::is_directory(data, error)) {
    root = data.has_parent_path() ? data.parent_path() : ".";
  }
  // Where the formats that are read have their photos.
  for (const char* folder :
       {".", "images", "images_2", "images_4", "images_8", "train", "test", "val"}) {
    if (same(output, root / folder)) refuse(output, data);
  }
}

void check_leftovers(const std::filesystem::path& output,
                     const std::vector<std::string>& names,
                     FrameFormat format,
                     bool overwrite) {
  const std::string extension = file_extension(format);
  std::set<std::string> own;
  for (const std::string& name : names) {
    own.insert(name + extension);
    for (const char* layer : {"_depth.png", "_normals.png", "_hits.png"}) own.insert(name + layer);
  }
  std::set<std::string> others;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(output, error)) {
    const std::string name = entry.path().filename().string();
    const bool hidden = name.starts_with('.');
    if (!hidden && entry.path().extension() == extension && !own.contains(name))
      others.insert(name);
  }
  if (others.empty()) return;
  const std::string what = others.size() == 1 ? fmt::format("the picture {}", *others.begin())
                                              : fmt::format("{} pictures ({} to {})", others.size(),
                                                            *others.begin(), *others.rbegin());
  if (!overwrite) {
    throw UsageError(fmt::format(
        "The folder {} holds {} that would stay beside the new ones: choose another folder, empty "
        "it, or write there all the same with --overwrite",
        output.string(), what));
  }
  spdlog::warn("{} holds {} of before", output.string(), what);
}

}  // namespace raysplats
