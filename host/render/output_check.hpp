// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "render/frame_writer.hpp"

namespace raysplats {

/// Throws UsageError when `output` is the folder of the data set or one with photos of it: pictures
/// are named after photos and would take their place.
void check_not_data(const std::filesystem::path& output, const Dataset& dataset);
/// The same where only the data set's folder, or a file with its cameras, is known.
void check_not_data(const std::filesystem::path& output, const std::filesystem::path& data);

/// The data set, whichever it is, whose folder this is or that has its photos, masks or depths in
/// it, by the names of the formats that are read and by what transforms*.json says; nothing for
/// other folders, runs in a data set's folder among them.
std::optional<std::filesystem::path> data_set_of(const std::filesystem::path& folder);
/// Throws UsageError, which names --overwrite, where there is one.
void check_outside_data(const std::filesystem::path& output);

/// Pictures in `output` that a writer of all `names` in `format` would leave beside its own, such
/// as later frames of a longer animation. Throws UsageError when there are any, and warns instead
/// with `overwrite`.
void check_leftovers(const std::filesystem::path& output,
                     const std::vector<std::string>& names,
                     FrameFormat format,
                     bool overwrite);

}  // namespace raysplats
