// SPDX-License-Identifier: Apache-2.0
#include "io/frame_lists.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <optional>
#include <utility>

namespace raysplats::io {
namespace {

using Names = std::set<std::string>;

Names names_of(const std::optional<std::vector<std::string>>& list) {
  Names names;
  for (const std::string& name : list.value_or(std::vector<std::string>{}))
    names.insert(inner_name(name));
  return names;
}

bool has_all(const Names& list, const Names& names) {
  return std::includes(list.begin(), list.end(), names.begin(), names.end());
}

void warn_of_unknown(const TransformsFile& file,
                     const Names& frames,
                     const Names& train,
                     const Names& test) {
  std::size_t unknown = 0;
  std::string first;
  for (const Names* list : {&train, &test}) {
    for (const std::string& name : *list) {
      if (frames.contains(name)) continue;
      if (unknown++ == 0) first = name;
    }
  }
  if (unknown == 0) return;
  spdlog::warn(
      "{}: {} of {} names in train_filenames, val_filenames and test_filenames are of no frame, "
      "'{}' among them: write them as the frames' file_path",
      file.path.string(), unknown, train.size() + test.size(), first);
}

void warn_of_shared(const TransformsFile& file, const Names& train, const Names& test) {
  std::vector<std::string> shared;
  std::set_intersection(train.begin(), train.end(), test.begin(), test.end(),
                        std::back_inserter(shared));
  if (shared.empty()) return;
  spdlog::warn(
      "{}: {} of {} names in its list of frames to train on are in that of frames to test too, "
      "'{}' among them: these are held out",
      file.path.string(), shared.size(), train.size(), shared.front());
}

}  // namespace

std::set<std::string> frame_names(const TransformsFile& file) {
  Names names;
  for (const TransformsFrame& frame : file.frames) names.insert(inner_name(frame.file_path));
  return names;
}

bool divide_by_lists(const TransformsFile& file, const Names& names, std::vector<View>& views) {
  const Names train = names_of(file.train_filenames);
  const Names validation = names_of(file.val_filenames);
  const Names test = file.test_filenames ? names_of(file.test_filenames) : validation;
  if (train.empty() && test.empty()) return false;
  if (has_all(train, names) && has_all(test, names)) {
    spdlog::info("the lists of {} name every frame to train on and to test: they are not used",
                 file.path.string());
    return false;
  }
  std::vector<View> used;
  std::size_t for_validation = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const std::string name = inner_name(file.frames[i].file_path);
    views[i].test = test.contains(name) || (test.empty() && !train.contains(name));
    if (views[i].test || train.empty() || train.contains(name)) {
      used.push_back(std::move(views[i]));
    } else if (validation.contains(name)) {
      ++for_validation;
    }
  }
  const std::size_t all = views.size();
  views = std::move(used);
  warn_of_unknown(file, names, train, test);
  warn_of_shared(file, train, test);
  if (for_validation > 0) {
    spdlog::info("{} of {} frames of {} are for validation only and left out", for_validation, all,
                 file.path.string());
  }
  if (const std::size_t rest = all - views.size() - for_validation; rest > 0) {
    spdlog::info("{} of {} frames of {} are in none of its lists and left out", rest, all,
                 file.path.string());
  }
  return true;
}

}  // namespace raysplats::io
