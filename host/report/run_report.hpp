// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace raysplats {

/// A page about a training run from the files of its folder: verdict and warnings, curves, held-out
/// views (photo, render, error: the worst, a typical and the best), settings that differ from the
/// defaults. One file without script or anything from elsewhere; well-formed XML. Throws DataError
/// for a folder that is no run or whose files are damaged.
std::string run_report(const std::filesystem::path& run);

/// Writes run_report() atomically.
void write_run_report(const std::filesystem::path& run, const std::filesystem::path& file);

}  // namespace raysplats
