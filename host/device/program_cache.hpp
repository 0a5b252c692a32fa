// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "raysplats/device.hpp"

namespace raysplats {

/// Compiled programs on disk, one file each: a header with a checksum, then the driver's binary.
/// Files are written under a temporary name and renamed, so concurrent processes never see half a
/// program; a file that does not check out is ignored and overwritten.
class ProgramCache {
 public:
  /// "" = ${XDG_CACHE_HOME:-~/.cache}/raysplats. An unusable directory turns the cache off.
  explicit ProgramCache(const std::string& directory);

  /// Key of a program: source, options, platform, device and driver.
  static std::string key(const std::string& source,
                         const std::string& options,
                         const DeviceInfo& device);

  std::optional<std::vector<unsigned char>> load(const std::string& key) const;
  void store(const std::string& key, const std::vector<unsigned char>& binary) const;
  void remove(const std::string& key) const;
  const std::filesystem::path& directory() const { return directory_; }

  /// Keeps others, processes and threads, from compiling the program of a key for this cache; gone
  /// with its process. Waits for its turn, and says so when that is long, for three minutes at
  /// most. Without a directory, or where the file system knows no locks, nothing is kept from
  /// anybody.
  class BuildLock {
   public:
    BuildLock(const std::filesystem::path& directory, const std::string& key);
    ~BuildLock();
    BuildLock(const BuildLock&) = delete;
    BuildLock& operator=(const BuildLock&) = delete;

   private:
    int descriptor_;
  };

 private:
  std::filesystem::path file(const std::string& key) const { return directory_ / (key + ".bin"); }
  std::filesystem::path directory_;  // empty = off
};

/// The directory used when none is named.
std::filesystem::path default_cache_directory();

/// What lies in a folder of compiled programs.
struct ProgramCacheState {
  std::size_t programs = 0;
  std::uintmax_t bytes = 0;
  std::string trouble;  ///< why nothing can be kept there; empty when it can
};
/// Makes the folder where it is missing, as the cache does.
ProgramCacheState program_cache_state(const std::filesystem::path& directory);

/// Removes every compiled program from `directory`, and what killed processes left there, and
/// returns how many programs there were. Those that other processes store meanwhile may stay or get
/// lost. Throws DataError without a folder.
std::size_t clear_program_cache(const std::filesystem::path& directory);

}  // namespace raysplats
