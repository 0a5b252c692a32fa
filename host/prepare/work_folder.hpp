// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "prepare/prepare.hpp"
#include "util/file_lock.hpp"

namespace raysplats {

/// The file of a step that is done, which holds its settings.
std::filesystem::path mark_of(const std::filesystem::path& data, const std::string& step);

/// The folder that is made, which no other run writes to meanwhile, and which of its steps are done
/// with which settings: "images", "features", "matches", "model", each made from those before it.
class WorkFolder {
 public:
  WorkFolder(const std::filesystem::path& data, const PrepareWatch& watch);

  /// Whether a step is still to be done with these settings.
  bool due(const std::string& name, const std::string& settings) const;
  /// Runs `action` if the step is due, and makes all later steps due.
  void step(const std::string& name,
            const std::string& settings,
            const std::function<void()>& action);
  /// Makes a step due and all later ones, even when this run ends before it comes to them.
  void forget(const std::string& name) const;

  /// Runs COLMAP for a step. `count` hears its lines, and sets how far it is by them.
  void colmap(const std::vector<std::string>& arguments,
              const std::string& step,
              const std::function<void(std::string_view, std::size_t& done)>& count,
              std::size_t total);
  /// What COLMAP says of the options of a command.
  std::string colmap_help(const std::string& command) const;

  const std::filesystem::path& data() const { return data_; }
  std::filesystem::path operator/(const char* name) const { return data_ / name; }
  std::string text(const char* name) const { return (data_ / name).string(); }
  std::filesystem::path log() const { return data_ / "prepare.log"; }
  bool watch(const std::string& step, std::size_t done, std::size_t total) const {
    return watch_(step, done, total);
  }

 private:
  std::filesystem::path data_;
  FileLock lock_;
  const PrepareWatch& watch_;
};

}  // namespace raysplats
