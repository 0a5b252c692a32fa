// SPDX-License-Identifier: Apache-2.0
#include "render/output_check.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <system_error>

#include "io/dataset/dataset_advice.hpp"
#include "raysplats/error.hpp"
#include "util/file_kind.hpp"

namespace raysplats {
namespace {

bool same(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code error;
  return std::filesystem::equivalent(a, b, error) && !error;
}

// Where the formats that are read have their pictures.
constexpr const char* kPictureFolders[] = {"images",
                                           "images_2",
                                           "images_4",
                                           "images_8",
                                           "train",
                                           "test",
                                           "val",
                                           "input",
                                           "masks",
                                           "mask",
                                           "depths",
                                           "keyframes/images",
                                           "keyframes/corrected_images",
                                           "keyframes/depth"};

// The folders of the files that transforms*.json in `root` name. What cannot be read names none.
std::set<std::filesystem::path> named_folders(const std::filesystem::path& root) {
  std::set<std::filesystem::path> out;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(root, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::filesystem::path& path = entry->path();
    if (path.extension() != ".json" || !path.filename().string().starts_with("transforms"))
      continue;
    std::ifstream stream(path, std::ios::binary);
    const nlohmann::json json = nlohmann::json::parse(stream, nullptr, false);
    if (!json.is_object() || !json.contains("frames")) continue;
    for (const nlohmann::json& frame : json["frames"]) {
      if (!frame.is_object()) continue;
      for (const auto& [key, value] : frame.items()) {
        if (key.ends_with("path") && value.is_string())
          out.insert((root / value.get<std::string>()).parent_path());
      }
    }
  }
  return out;
}

bool is_run(const std::filesystem::path& folder) {
  return is_file(folder / "config.toml") && is_file(folder / "cameras.json");
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
  if (same(output, root)) refuse(output, data);
  for (const char* folder : kPictureFolders) {
    if (same(output, root / folder)) refuse(output, data);
  }
}

std::optional<std::filesystem::path> data_set_of(const std::filesystem::path& folder) {
  if (is_run(folder)) return std::nullopt;
  if (io::looks_like_dataset(folder)) return folder;
  std::error_code error;
  const std::filesystem::path whole = std::filesystem::weakly_canonical(folder, error);
  std::optional<std::filesystem::path> root = io::enclosing_data_set(whole);
  if (error || !root) return std::nullopt;
  std::set<std::filesystem::path> pictures = named_folders(*root);
  for (const char* name : kPictureFolders) pictures.insert(*root / name);
  for (std::filesystem::path part = whole; !same(part, *root) && part.has_relative_path();
       part = part.parent_path()) {
    if (is_run(part)) return std::nullopt;
    for (const std::filesystem::path& each : pictures) {
      if (same(part, each)) return root;
    }
  }
  return std::nullopt;
}

void check_outside_data(const std::filesystem::path& output) {
  const std::optional<std::filesystem::path> data = data_set_of(output);
  if (!data) return;
  throw UsageError(fmt::format(
      "The output folder {} belongs to the data set {}, whose photos could be lost: choose another "
      "with -o, or write there all the same with --overwrite",
      output.string(), data->string()));
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
