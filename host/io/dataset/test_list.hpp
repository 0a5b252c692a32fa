// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Finds photos by their names as people and other programs write them.
class PhotoNames {
 public:
  explicit PhotoNames(std::span<const View> views);

  /// The name of the camera whose photo is meant: by that name, else by it without its extension,
  /// else by a path that ends so, of several the longest, else by the end of it, each with its
  /// extension or without. Nothing where that is of no photo, or of several.
  std::optional<std::string> find(const std::string& written) const;

 private:
  struct Spelling {
    std::string name;     ///< of the camera
    std::string written;  ///< that name, as it is, as the file has it, or without its extension
    int rank;             ///< of what is written just so; lower ones go before
  };
  void add(const std::string& name, const std::string& written, int rank);
  static std::set<std::string> names_of(std::span<const Spelling> spellings,
                                        const std::function<bool(const Spelling&)>& fits);

  std::map<std::string, std::vector<Spelling>, std::less<>> by_last_;  // part of the path
};

/// The names of a text that has one in each line; what is blank and comments (#) are passed over.
std::set<std::string> names_in(std::string_view text);
/// The same as that text.
std::string text_of(const std::set<std::string>& names);

/// Holds out the photos that `list` names, and leaves out those that `dataset` holds out besides.
/// Throws UsageError for names that mean no photo or several.
void hold_out(Dataset& dataset, const std::set<std::string>& list);

}  // namespace raysplats::io
