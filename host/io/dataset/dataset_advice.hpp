// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace raysplats::io {

/// Whether a folder holds what load_dataset() looks for by its name: a data set, whole or not.
bool looks_like_dataset(const std::filesystem::path& folder);

/// The data set that a folder is a part of, as `images` and `sparse/0` are, by its absolute path;
/// nothing where there is none.
std::optional<std::filesystem::path> enclosing_data_set(const std::filesystem::path& root);

/// The end of a sentence that says what to give in place of a folder that is no data set: archives
/// unpack to a folder in a folder, parts of a data set are none, other programs have folders of
/// their own, and photos may have no cameras yet. "" where there is nothing to say.
std::string advice_for(const std::filesystem::path& root);

}  // namespace raysplats::io
