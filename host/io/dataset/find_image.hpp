// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace raysplats::io {

/// The image that `file_path` means, relative to `folder` and possibly without extension; nothing
/// when absent.
std::optional<std::filesystem::path> find_image(const std::filesystem::path& folder,
                                                const std::filesystem::path& file_path);

/// The single image that differs from that path in its extension alone: photos were converted, or
/// the path says .jpeg of a .jpg.
std::optional<std::filesystem::path> find_reformatted(const std::filesystem::path& folder,
                                                      const std::filesystem::path& file_path);

/// The image by the end of a path that was written elsewhere (C:/captures/fox/images/1.jpg): the
/// longest that is there, of `least_parts` or more; a name alone also in the folder images.
std::optional<std::filesystem::path> find_moved(const std::filesystem::path& folder,
                                                const std::filesystem::path& file_path,
                                                std::size_t least_parts);

/// A file that a data set in `folder` names: where the name says, else as find_moved() finds it,
/// else where the name says although nothing is there.
std::filesystem::path find_beside(const std::filesystem::path& folder,
                                  const std::filesystem::path& file_path,
                                  std::size_t least_parts);

/// Finds what differs from a name in letter case alone, or in that the marks of its letters are
/// characters of their own: systems that do not tell them apart have written the name. A folder is
/// listed once, when the first name is sought in it, and what is put there later stays unknown.
class RespeltFinder {
 public:
  /// The single image that differs so from that path, in folders or name; the path is relative to
  /// `folder` and may have no extension.
  std::optional<std::filesystem::path> find(const std::filesystem::path& folder,
                                            const std::filesystem::path& file_path);

  /// The folder of that name in another, or the single one that differs from it so.
  std::optional<std::filesystem::path> find_folder(const std::filesystem::path& folder,
                                                   std::string_view name);

 private:
  /// Names of entries by what they are in small letters without marks.
  using Names = std::multimap<std::string, std::string>;
  struct Listing {
    Names by_name;
    Names by_stem;
  };
  const Listing& listing(const std::filesystem::path& folder);

  std::map<std::filesystem::path, Listing> listings_;
};

}  // namespace raysplats::io
