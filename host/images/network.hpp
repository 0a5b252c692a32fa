// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "io/image/image_codec.hpp"

namespace raysplats::io {

/// Whether this build has OpenCV's DNN module.
bool networks_available();

/// Throws UsageError without it, DataError for a file that is no network.
std::unique_ptr<PerceptualNetwork> load_network(const std::filesystem::path& path);

}  // namespace raysplats::io
