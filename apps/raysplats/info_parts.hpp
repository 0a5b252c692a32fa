// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

namespace raysplats::cli {

// Descriptions of files that belong to something larger: a capture, a mesh, a run, a measurement.
// All say by "type" what they are; nothing where name and content are something else. They throw
// what the readers of the files throw.

/// Points of a PLY without faces and without what Gaussians have.
std::optional<nlohmann::ordered_json> describe_points(const std::filesystem::path& path);

/// A COLMAP model of which this is the folder, or one of its files: cameras, images or points3D as
/// .bin or .txt. A folder that has photos too is a data set, and not described here.
std::optional<nlohmann::ordered_json> describe_colmap(const std::filesystem::path& path);

/// Materials of an .mtl file.
nlohmann::ordered_json describe_materials(const std::filesystem::path& path);

/// An .onnx file that `eval --lpips` takes.
nlohmann::ordered_json describe_network(const std::filesystem::path& path);

/// JSON that this program or nerfstudio writes: exposures, metrics of a run or of an evaluation, a
/// benchmark, a tuning, dataparser_transforms.json.
std::optional<nlohmann::ordered_json> describe_record(const nlohmann::json& json,
                                                      const std::filesystem::path& path);

}  // namespace raysplats::cli
