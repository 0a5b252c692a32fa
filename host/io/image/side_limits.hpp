// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace raysplats::io {

/// Throws UsageError for more pixels along a side than a picture or video of this name can have, by
/// its extension: what the format has no numbers for, or what its library refuses. Other extensions
/// have no limit here.
void require_writable_size(const std::filesystem::path& path, int width, int height);

}  // namespace raysplats::io
