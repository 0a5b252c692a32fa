// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <string>

#include "raysplats/gaussians.hpp"
#include "raysplats/io.hpp"

namespace raysplats::io {

/// A compressed PLY is read as kPly, which its first bytes say.
enum class ModelFormat { kPly, kCompressedPly, kSplat, kSpz, kSog, kGltf, kUnknown };

/// What is read of a model: of the folder of an unpacked SOG its meta.json, else the path itself.
std::filesystem::path file_of(const std::filesystem::path& path);

/// What a file is, by its first bytes, else by its extension.
ModelFormat model_format(const std::filesystem::path& path);

/// From where its positions count (read_ply_origin()); 0 for formats that do not say it.
std::array<double, 3> model_origin(const std::filesystem::path& path);

/// What a file of this name is written as. Throws UsageError for names that do not say it.
ModelFormat output_format(const std::filesystem::path& path);

/// What losses() says of a format that keeps every number of the model.
inline constexpr const char* kNoLoss = "nothing is lost";
/// What the format does not keep of a model, as part of a sentence.
std::string losses(ModelFormat format, const Gaussians& model);

}  // namespace raysplats::io
