// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
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
  std::string split;            ///< split_fingerprint(); empty in older files
  std::uint32_t bad_steps = 0;  ///< StepGuard::Counts
  std::uint32_t bad_steps_in_a_row = 0;
  std::uint64_t traced_rays = 0;  ///< of all training views so far; 0 in older files, as the next
  std::uint64_t capped_rays = 0;  ///< of them, those that stopped because of max_hits
  std::uint64_t skipped_updates = 0;  ///< of Adam so far; 0 in older files
  std::int64_t mean_since = 0;  ///< iterations before those that the mean of the parameters is of
  /// Iterations before those that train on the views of validate-views too, as planned or past; 0
  /// without such views and in older files.
  std::int64_t views_joined = 0;
  /// Iterations before those that do without the photos of the section "left_out"; 0 without such
  /// photos and in older files.
  std::int64_t left_out_from = 0;
  /// The run failed within the iteration, after its step: what follows a step, density control
  /// among it, is still to come.
  bool pass_due = false;
  std::string config;                                  ///< configuration of the run, TOML
  std::map<std::string, std::vector<float>> sections;  ///< names of at most 31 characters
};

/// Writes atomically. Throws DataError when the file cannot be written.
void write_checkpoint(const std::filesystem::path& path, const Checkpoint& checkpoint);

/// Sections by name, each made when it is its turn to be written.
using CheckpointSections = std::map<std::string, std::function<std::vector<float>()>>;
/// The same file with these sections in place of the checkpoint's own, of which memory holds one at
/// a time: together they are many times the model.
void write_checkpoint(const std::filesystem::path& path,
                      const Checkpoint& checkpoint,
                      const CheckpointSections& sections);

/// Reads and verifies every length and checksum. Throws DataError that names the file and what is
/// wrong with it.
Checkpoint read_checkpoint(const std::filesystem::path& path);

/// The configuration that a checkpoint file, or the newest of a run folder whose header is whole,
/// names; sections are not read. "" without one. Throws DataError like read_checkpoint() for a
/// file.
std::string checkpoint_config(const std::filesystem::path& path);

/// The run folder of a path that one resumes from: of a file the one in whose checkpoints/ it is,
/// nothing for a file elsewhere; else the path itself.
std::optional<std::filesystem::path> run_folder_of(const std::filesystem::path& path);

/// The file of an iteration in the run folder: checkpoints/step_000007000.rsck.
std::filesystem::path checkpoint_path(const std::filesystem::path& run_folder,
                                      std::int64_t iteration);

/// The checkpoint files of a run folder, oldest first.
std::vector<std::filesystem::path> list_checkpoints(const std::filesystem::path& run_folder);

/// The newest checkpoint of the run folder that is valid; damaged ones are skipped with a warning.
/// `path` may also be a single file. Throws DataError when there is none.
Checkpoint load_latest_checkpoint(const std::filesystem::path& path);

/// Removes all but the newest `keep` checkpoints of a run folder up to `iteration`; what is beyond
/// it is not of the run that is at `iteration`.
void remove_old_checkpoints(const std::filesystem::path& run_folder,
                            int keep,
                            std::int64_t iteration);

}  // namespace raysplats
