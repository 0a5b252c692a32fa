// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/find_image.hpp"

#include <algorithm>
#include <cctype>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/image/image_file.hpp"
#include "util/ascii.hpp"
#include "util/file_kind.hpp"
#include "util/path_text.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

/// The letters that those of U+00C0 to U+017F are with a mark on them; a point for the others.
constexpr std::string_view kBaseLetters =
    "AAAAAA.CEEEEIIII.NOOOOO..UUUUY..aaaaaa.ceeeeiiii.nooooo..uuuuy.y"
    "AaAaAaCcCcCcCcDd..EeEeEeEeEeGgGgGgGgHh..IiIiIiIiI...JjKk.LlLlLl."
    "...NnNnNn...OoOoOo..RrRrRrSsSsSsSsTtTt..UuUuUuUuUuUuWwYyYZzZzZz.";
static_assert(kBaseLetters.size() == 0x180 - 0xC0);
constexpr unsigned kFirstLetter = 0xC0, kFirstMark = 0x300, kLastMark = 0x36F;

/// The character of U+0080 to U+07FF whose two bytes of UTF-8 begin at `at`; 0 for others.
unsigned two_byte_character(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u;
  };
  const bool is_one = (byte(at) & 0xE0u) == 0xC0u && (byte(at + 1) & 0xC0u) == 0x80u;
  return is_one ? (byte(at) & 0x1Fu) << 6 | (byte(at + 1) & 0x3Fu) : 0u;
}

struct BareName {
  std::string text;       ///< without the marks on its letters
  bool has_mark = false;  ///< whether one was a character of its own, as macOS writes them
};

BareName without_marks(std::string_view name) {
  BareName out;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const unsigned character = two_byte_character(name, i);
    const bool is_mark = character >= kFirstMark && character <= kLastMark;
    const char base = character >= kFirstLetter && character < kFirstLetter + kBaseLetters.size()
                          ? kBaseLetters[character - kFirstLetter]
                          : '.';
    if (is_mark) {
      out.has_mark = true;
      ++i;
    } else if (base != '.') {
      out.text += base;
      ++i;
    } else {
      out.text += name[i];
    }
  }
  return out;
}

/// Whether two names differ in nothing but the case of A to Z.
bool same_but_case(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [&](char x, char y) { return ascii_lower(x) == ascii_lower(y); });
}

/// Likewise, also where one has letters with marks and the other has these as two characters.
bool same_but_spelling(std::string_view a, std::string_view b) {
  if (same_but_case(a, b)) return true;
  // The first bytes of all marks, looked for first as folders have many names.
  constexpr std::string_view kMarkBytes = "\xCC\xCD";
  if (a.find_first_of(kMarkBytes) == a.npos && b.find_first_of(kMarkBytes) == b.npos) return false;
  const BareName bare_a = without_marks(a), bare_b = without_marks(b);
  return bare_a.has_mark != bare_b.has_mark && same_but_case(bare_a.text, bare_b.text);
}

/// What all names have in common that same_but_spelling() takes for one.
std::string folded(std::string_view name) { return ascii_lower(without_marks(name).text); }

/// The single one of the names of a folder's entries, folded as `name` is, that is wanted; nothing
/// when there is none or several.
std::optional<fs::path> only_entry(const fs::path& folder,
                                   const std::multimap<std::string, std::string>& names,
                                   std::string_view name,
                                   const std::function<bool(const fs::path&)>& wanted) {
  std::optional<fs::path> found;
  const auto [first, last] = names.equal_range(folded(name));
  for (auto entry = first; entry != last; ++entry) {
    fs::path path = folder / entry->second;
    if (!wanted(path)) continue;
    if (found) return std::nullopt;
    found = std::move(path);
  }
  return found;
}

/// The file at a path, in one spelling of all that lead to it by "." and "..". The name before a
/// ".." may be that of a link, which leads elsewhere than the names alone; these count where it is
/// that of nothing.
std::optional<fs::path> file_at(const fs::path& path) {
  const fs::path normal = path.lexically_normal();
  if (!is_file(path)) {
    const bool leads_nowhere = normal != path && !is_folder(path.parent_path());
    return leads_nowhere && is_file(normal) ? std::optional(normal) : std::nullopt;
  }
  std::error_code error;
  if (normal == path || fs::equivalent(path, normal, error)) return normal;
  const fs::path folder = fs::canonical(path.parent_path(), error);
  return error ? path : folder / path.filename();
}

}  // namespace

std::optional<fs::path> find_image(const fs::path& folder, const fs::path& file_path) {
  const fs::path exact = folder / file_path;
  if (auto file = file_at(exact)) return file;
  // Without an extension any will do; with one only its case may differ.
  const bool named = has_image_extension(exact);
  const std::string stem = named ? fs::path(exact).replace_extension().string() : exact.string();
  for (std::string extension : kImageExtensions) {
    if (named && lower_extension(exact) != extension) continue;
    if (auto file = file_at(stem + extension)) return file;
    for (char& c : extension) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    if (auto file = file_at(stem + extension)) return file;
  }
  return std::nullopt;
}

std::optional<fs::path> find_reformatted(const fs::path& folder, const fs::path& file_path) {
  if (!has_image_extension(file_path)) return std::nullopt;
  std::optional<fs::path> found;
  for (const char* extension : kImageExtensions) {
    auto other = find_image(folder, fs::path(file_path).replace_extension(extension));
    if (!other) continue;
    if (found) return std::nullopt;
    found = std::move(other);
  }
  return found;
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

std::optional<fs::path> RespeltFinder::find(const fs::path& folder, const fs::path& file_path) {
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
  const Listing& entries = listing(place);
  return only_entry(
      place, named ? entries.by_name : entries.by_stem, name, [&](const fs::path& entry) {
        return same_but_spelling((named ? entry.filename() : entry.stem()).string(), name) &&
               has_image_extension(entry) && is_file(entry);
      });
}

std::optional<fs::path> RespeltFinder::find_folder(const fs::path& folder, std::string_view name) {
  if (is_folder(folder / name)) return folder / name;
  return only_entry(folder, listing(folder).by_name, name, [&](const fs::path& entry) {
    return same_but_spelling(entry.filename().string(), name) && is_folder(entry);
  });
}

const RespeltFinder::Listing& RespeltFinder::listing(const fs::path& folder) {
  const auto [known, is_new] = listings_.try_emplace(folder);
  Listing& out = known->second;
  if (!is_new) return out;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    out.by_name.emplace(folded(name), name);
    out.by_stem.emplace(folded(entry->path().stem().string()), name);
  }
  return out;
}

}  // namespace raysplats::io
