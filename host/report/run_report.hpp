// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace raysplats {

/// A page about a training run from the files of its folder: verdict and warnings, curves, held-out
/// views (photo, render, error: the worst, a typical and the best), settings that differ from the
/// defaults. One file without script or anything from elsewhere; well-formed XML. Damaged pictures,
/// cameras, exposures and models are told in their place. Throws DataError for a folder that is no
/// run or whose other files are damaged.
std::string run_report(const std::filesystem::path& run);

/// The files of a run that its page is made from, those that are not there among them, with all
/// pictures of its last evaluation. Throws DataError as run_report().
std::vector<std::filesystem::path> report_inputs(const std::filesystem::path& run);

/// Writes run_report() atomically. Returns one line about the warnings that the page begins with:
/// how many there are, and the first; "" for none.
std::string write_run_report(const std::filesystem::path& run, const std::filesystem::path& file);

/// A page about 2 to 12 runs side by side: figures, curves, the views in which they differ most,
/// the settings in which they differ. Throws DataError as run_report(), UsageError for another
/// number.
std::string runs_report(const std::vector<std::filesystem::path>& runs);

}  // namespace raysplats
