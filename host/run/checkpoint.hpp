// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace raysplats {

/// The whole state of a training run between two iterations, and nothing else: equal states give
/// equal files (no times, no paths). As a file (.rsck, little-endian):
///   8 bytes "RSCKPT\r\n" | u32 version | u32 number of sections | u64 bytes of the header | u64
///   xxh64 of the header | header (JSON: everything that is no array) | section table, 56 bytes
///   each: name (32 bytes, zero-padded), u64 offset in the file, u64 bytes, u64 xxh64 | u64 xxh64
///   of the table | the sections (32-bit floats), back to back.
struct Checkpoint {
  std::int64_t iteration = 0;  ///< completed iterations
  std::uint64_t count = 0;     ///< Gaussians
  std::uint64_t seed = 0;
  std::int64_t optimiser_steps = 0;
  int sh_degree = 0;
  int active_sh_degree = 0;
  std::string scale_activation;  ///< "exp" or "sigmoid"
  double scene_extent = 0;
  std::string dataset;          ///< dataset_fingerprint(); empty in files of version 1
  std::uint32_t bad_steps = 0;  ///< StepGuard::Counts
  std::uint32_t bad_steps_in_a_row = 0;
  std::uint64_t traced_rays = 0;  ///< of all training views so far; 0 in older files, as the next
  std::uint64_t capped_rays = 0;  ///< of them, those that stopped because of max_hits
  std::int64_t mean_since = 0;    ///< iterations before those that the mean of the parameters is of
  std::string config;             ///< configuration of the run, TOML
  std::map<std::string, std::vector<float>> sections;  ///< names of at most 31 characters
};

/// Writes atomically. Throws DataError when the file cannot be written.
void write_checkpoint(const std::filesystem::path& path, const Checkpoint& checkpoint);

/// Reads and verifies every length and checksum. Throws DataError that names the file and what is
/// wrong with it.
Checkpoint read_checkpoint(const std::filesystem::path& path);

/// The file of an iteration in the run folder: checkpoints/step_000007000.rsck.
std::filesystem::path checkpoint_path(const std::filesystem::path& run_folder,
                                      std::int64_t iteration);

/// The checkpoint files of a run folder, oldest first.
std::vector<std::filesystem::path> list_checkpoints(const std::filesystem::path& run_folder);

/// The newest checkpoint of the run folder that is valid; damaged ones are skipped with a warning.
/// `path` may also be a single .rsck file. Throws DataError when there is none.
Checkpoint load_latest_checkpoint(const std::filesystem::path& path);

/// Removes all but the newest `keep` checkpoints of a run folder up to `iteration`; what is beyond
/// it is not of the run that is at `iteration`.
void remove_old_checkpoints(const std::filesystem::path& run_folder,
                            int keep,
                            std::int64_t iteration);

}  // namespace raysplats
