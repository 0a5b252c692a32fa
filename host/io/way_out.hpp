// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace raysplats::io {

/// The end of a sentence that says what to give in place of a folder that is no data set: archives
/// unpack to a folder in a folder, other programs have folders of their own, and photos may have no
/// cameras yet. "" where there is nothing to say.
std::string way_out(const std::filesystem::path& root);

}  // namespace raysplats::io
