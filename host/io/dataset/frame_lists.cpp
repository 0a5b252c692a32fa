// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/frame_lists.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "io/dataset/test_list.hpp"
#include "io/json_file.hpp"
#include "raysplats/error.hpp"
#include "util/file_kind.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

using Names = std::set<std::string>;

/// What files say of the photos of a data set.
struct Lists {
  fs::path place;      ///< the file that says so
  const char* photo;   ///< what a photo is called there
  const char* advice;  ///< how names are written
  Names train, validation, test;
};

Names names_of(const std::optional<std::vector<std::string>>& list) {
  Names names;
  for (const std::string& name : list.value_or(std::vector<std::string>{}))
    names.insert(inner_name(name));
  return names;
}

bool has_all(const Names& list, const Names& names) {
  return std::includes(list.begin(), list.end(), names.begin(), names.end());
}

void warn_of_unknown(const Lists& lists, const Names& names) {
  std::size_t unknown = 0;
  std::string first;
  for (const Names* list : {&lists.train, &lists.test}) {
    for (const std::string& name : *list) {
      if (names.contains(name)) continue;
      if (unknown++ == 0) first = name;
    }
  }
  if (unknown == 0) return;
  spdlog::warn(
      "{}: {} of {} names in its lists of {}s to train on and to test are of no {}, '{}' among "
      "them: {}",
      lists.place.string(), unknown, lists.train.size() + lists.test.size(), lists.photo,
      lists.photo, first, lists.advice);
}

void warn_of_shared(const Lists& lists, bool all) {
  std::vector<std::string> shared;
  std::set_intersection(lists.train.begin(), lists.train.end(), lists.test.begin(),
                        lists.test.end(), std::back_inserter(shared));
  if (shared.empty()) return;
  spdlog::warn(
      "{}: {} of {} names in its list of {}s to train on are in that of {}s to test too, "
      "'{}' among them: {}",
      lists.place.string(), shared.size(), lists.train.size(), lists.photo, lists.photo,
      shared.front(),
      all ? "what of these --test-list does not name is left out" : "these are held out");
}

/// `keys`: the names of `views`, as the lists would have them; `names`: of all photos there are or
/// should be.
bool divide(const Lists& lists,
            const Names& names,
            const std::vector<std::string>& keys,
            bool all,
            std::vector<View>& views) {
  const auto& [place, photo, advice, train, validation, test] = lists;
  if (train.empty() && test.empty()) return false;
  if (has_all(train, names) && has_all(test, names)) {
    spdlog::info("the lists of {} name every {} to train on and to test: they are not used",
                 place.string(), photo);
    return false;
  }
  std::vector<View> used;
  std::size_t for_validation = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const std::string& name = keys[i];
    const bool trained = train.empty() || train.contains(name);
    views[i].test = test.contains(name) || (test.empty() && !train.contains(name));
    if (all && !trained) views[i].test = true;
    if (views[i].test || trained) {
      used.push_back(std::move(views[i]));
    } else if (validation.contains(name)) {
      ++for_validation;
    }
  }
  const std::size_t count = views.size();
  views = std::move(used);
  warn_of_unknown(lists, names);
  warn_of_shared(lists, all);
  if (for_validation > 0) {
    spdlog::info("{} of {} {}s of {} are for validation only and left out", for_validation, count,
                 photo, place.string());
  }
  if (const std::size_t rest = count - views.size() - for_validation; rest > 0) {
    spdlog::info("{} of {} {}s of {} are in none of its lists and left out", rest, count, photo,
                 place.string());
  }
  return true;
}

Names read_if_there(const fs::path& path) { return is_file(path) ? read_test_list(path) : Names(); }

/// The texts of a list in an object; what is none counts as not there.
Names texts_of(const nlohmann::json& object, const char* key) {
  Names names;
  const auto list = object.find(key);
  if (list == object.end() || !list->is_array()) return names;
  for (const nlohmann::json& item : *list) {
    if (item.is_string()) names.insert(item.get<std::string>());
  }
  return names;
}

/// The lists that may come with a model, those that go before others first.
std::vector<std::function<std::optional<Lists>()>> colmap_lists(const fs::path& model_folder,
                                                                const fs::path& root) {
  const auto lists_of = [](fs::path place, Names train, Names test) {
    return Lists{.place = std::move(place),
                 .photo = "photo",
                 .advice = "write them as the model does",
                 .train = std::move(train),
                 .validation = {},
                 .test = std::move(test)};
  };
  return {[=]() -> std::optional<Lists> {
            const fs::path path = model_folder / "test.txt";
            if (!is_file(path)) return std::nullopt;
            return lists_of(path, {}, read_test_list(path));
          },
          [=]() -> std::optional<Lists> {
            const fs::path test = root / "test_list.txt", train = root / "train_list.txt";
            if (!is_file(test) && !is_file(train)) return std::nullopt;
            return lists_of(is_file(test) ? test : train, read_if_there(train),
                            read_if_there(test));
          },
          [=]() -> std::optional<Lists> {
            const fs::path path = root / "train_test_lists.json";
            if (!is_file(path)) return std::nullopt;
            const nlohmann::json object = read_json_object(path);
            return lists_of(path, texts_of(object, "train"), texts_of(object, "test"));
          }};
}

/// Names as the model has them.
Names spelt(const Names& list, const PhotoNames& photos) {
  Names names;
  for (const std::string& written : list)
    names.insert(photos.find(written).value_or(inner_name(written)));
  return names;
}

bool names_any(const Lists& lists, const Names& names) {
  return std::any_of(names.begin(), names.end(), [&](const std::string& name) {
    return lists.train.contains(name) || lists.test.contains(name);
  });
}

/// Whether the lists keep none of the photos to train on.
bool train_on_none(const Lists& lists, const std::vector<std::string>& keys) {
  return std::none_of(keys.begin(), keys.end(), [&](const std::string& name) {
    return !lists.test.contains(name) && (lists.train.empty() || lists.train.contains(name));
  });
}

}  // namespace

std::set<std::string> frame_names(const TransformsFile& file) {
  Names names;
  for (const TransformsFrame& frame : file.frames) names.insert(inner_name(frame.file_path));
  return names;
}

bool divide_by_lists(const TransformsFile& file,
                     const Names& names,
                     bool all,
                     std::vector<View>& views) {
  const Names validation = names_of(file.val_filenames);
  const Lists lists{.place = file.path,
                    .photo = "frame",
                    .advice = "write them as the frames' file_path",
                    .train = names_of(file.train_filenames),
                    .validation = validation,
                    .test = file.test_filenames ? names_of(file.test_filenames) : validation};
  std::vector<std::string> keys;
  keys.reserve(views.size());
  for (const TransformsFrame& frame : file.frames) keys.push_back(inner_name(frame.file_path));
  return divide(lists, names, keys, all, views);
}

bool divide_by_lists(const ColmapModel& model,
                     const fs::path& model_folder,
                     const fs::path& root,
                     bool all,
                     std::vector<View>& views) {
  Names names;
  for (const ColmapImage& image : model.images) names.insert(inner_name(image.name));
  std::vector<std::string> keys;
  keys.reserve(views.size());
  for (const View& view : views) keys.push_back(view.camera.name);
  const PhotoNames photos(views);
  for (const auto& read : colmap_lists(model_folder, root)) {
    std::optional<Lists> lists = read();
    if (!lists) continue;
    lists->train = spelt(lists->train, photos);
    lists->test = spelt(lists->test, photos);
    const std::string place = lists->place.string();
    if (!names_any(*lists, names)) {
      spdlog::warn("{} names no photo of the COLMAP model {}: it is not used", place,
                   model_folder.string());
    } else if (!has_all(lists->train, names) && train_on_none(*lists, keys)) {
      spdlog::warn(
          "{} {} the COLMAP model {}: it is not used", place,
          lists->train.empty() ? "holds out every photo of" : "leaves no photo to train on of",
          model_folder.string());
    } else if (divide(*lists, names, keys, all, views)) {
      if (!all) spdlog::info("the photos that are held out are those of {}", place);
      return true;
    }
  }
  return false;
}

}  // namespace raysplats::io
