// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/test_list.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <vector>

#include "io/byte_reader.hpp"
#include "io/dataset/transforms.hpp"
#include "io/text_reader.hpp"
#include "raysplats/error.hpp"
#include "util/path_text.hpp"

namespace raysplats {
namespace io {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxBytes = std::uint64_t{16} << 20;

std::string without_extension(const std::string& name) {
  return fs::path(name).replace_extension().generic_string();
}

std::string last_part(const std::string& name) { return fs::path(name).filename().string(); }

/// The last rank, which ends of all spellings share.
constexpr int kEnds = 2;

/// Whether `end` is the end of a path, from one of its parts on.
bool ends_path(const std::string& path, const std::string& end) {
  return path.ends_with(end) &&
         (path.size() == end.size() || path[path.size() - end.size() - 1] == '/');
}

std::optional<std::string> only(const std::set<std::string>& names) {
  return names.size() == 1 ? std::optional(*names.begin()) : std::nullopt;
}

std::set<std::string> read_names(TextReader reader) {
  std::set<std::string> names;
  while (reader.next_content_line())
    names.insert(portable_path(std::string(reader.rest())).lexically_normal().string());
  return names;
}

}  // namespace

PhotoNames::PhotoNames(std::span<const View> views) {
  for (const View& view : views) {
    const std::string& name = view.camera.name;
    add(name, name, 0);
    add(name, without_extension(name), 1);
    // The file may have another extension, or other letter case, than the camera's name.
    const fs::path file = fs::path(name).replace_filename(view.image_path.filename());
    add(name, file.generic_string(), kEnds);
    add(name, without_extension(file.generic_string()), kEnds);
  }
}

void PhotoNames::add(const std::string& name, const std::string& written, int rank) {
  by_last_[last_part(written)].push_back({name, written, rank});
}

std::set<std::string> PhotoNames::names_of(std::span<const Spelling> spellings,
                                           const std::function<bool(const Spelling&)>& fits) {
  std::set<std::string> names;
  for (const Spelling& each : spellings)
    if (fits(each)) names.insert(each.name);
  return names;
}

std::optional<std::string> PhotoNames::find(const std::string& written) const {
  const std::string wanted = inner_name(portable_path(written));
  const auto found = by_last_.find(last_part(wanted));
  if (wanted.empty() || found == by_last_.end()) return std::nullopt;
  const std::vector<Spelling>& spellings = found->second;
  for (int rank = 0; rank < kEnds; ++rank) {
    const std::set<std::string> names = names_of(spellings, [&](const Spelling& each) {
      return each.rank == rank && each.written == wanted;
    });
    if (!names.empty()) return only(names);
  }
  // Of photos that a path ends in the names of, that of the longest is meant.
  std::size_t longest = 0;
  for (const Spelling& each : spellings)
    if (ends_path(wanted, each.written)) longest = std::max(longest, each.written.size());
  return only(names_of(spellings, [&](const Spelling& each) {
    return longest > 0 ? each.written.size() == longest && ends_path(wanted, each.written)
                       : ends_path(each.written, wanted);
  }));
}

std::set<std::string> names_in(std::string_view text) {
  return read_names(TextReader(std::as_bytes(std::span(text)), {}));
}

std::string text_of(const std::set<std::string>& names) {
  // A text of no lines would be no list.
  std::string text = names.empty() ? "# none\n" : "";
  for (const std::string& name : names)
    text += fmt::format("{}{}\n", name.starts_with('#') ? "./" : "", name);
  return text;
}

void hold_out(Dataset& dataset, const std::set<std::string>& list) {
  const PhotoNames photos(dataset.views);
  std::set<std::string> named;
  std::size_t unknown = 0;
  std::string first;
  for (const std::string& written : list) {
    if (const std::optional<std::string> photo = photos.find(written)) {
      named.insert(*photo);
    } else if (unknown++ == 0) {
      first = written;
    }
  }
  if (unknown > 0) {
    throw UsageError(fmt::format(
        "{} of {} names in the list of test photos mean no photo of {}, or several, '{}' the "
        "first: write them as the data set does, or give another 'test-list' or 'test-every'",
        unknown, list.size(), dataset.root.string(), first));
  }
  const std::size_t all = dataset.views.size();
  const auto is_named = [&](const View& view) { return named.contains(view.camera.name); };
  std::erase_if(dataset.views, [&](const View& view) { return view.test && !is_named(view); });
  for (View& view : dataset.views) view.test = is_named(view);
  if (const std::size_t out = all - dataset.views.size(); out > 0) {
    spdlog::info(
        "{} of {} photos are left out: the data set says that they are not to be trained on, and "
        "the list of test photos does not name them",
        out, all);
  }
}

}  // namespace io

std::set<std::string> read_test_list(const std::filesystem::path& path) {
  return io::read_names(io::TextReader(io::read_file(path, io::kMaxBytes), path));
}

}  // namespace raysplats
