// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "io/dataset/colmap_model.hpp"
#include "io/dataset/transforms.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// What the lists of a nerfstudio file (train_filenames and the like) compare: inner_name() of the
/// path of every frame.
std::set<std::string> frame_names(const TransformsFile& file);

/// Divides `views`, those of file.frames in their order, as the file's lists say, and leaves out
/// those that are of neither side, or holds them out too where `all` is asked for. Names of
/// test_filenames are held out, or of val_filenames where there is no such list, also those that
/// are to be trained on too, which is warned of. `names`: of all frames, also those whose photo is
/// missing. False, with the views as they were, where there are no lists or all of them name every
/// frame.
bool divide_by_lists(const TransformsFile& file,
                     const std::set<std::string>& names,
                     bool all,
                     std::vector<View>& views);

/// The same of a COLMAP model by the lists that come with it, the first of these, which a line
/// names unless `all` is asked for: test.txt beside the model (3DGS), train_list.txt and
/// test_list.txt (nerfstudio, NerfBaselines) and train_test_lists.json (ScanNet++) in the data
/// set's folder. Lists of which no name is of the model's, and those that leave nothing to train
/// on, are passed over with a warning.
bool divide_by_lists(const ColmapModel& model,
                     const std::filesystem::path& model_folder,
                     const std::filesystem::path& root,
                     bool all,
                     std::vector<View>& views);

}  // namespace raysplats::io
