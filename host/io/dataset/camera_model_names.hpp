// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "raysplats/camera.hpp"

/// What transforms files call models of cameras: nerfstudio's names and others of the same lenses.
namespace raysplats::io {

/// The model of a name, whatever the case of its letters and what separates its words. kPinhole
/// stands for all lenses of planes: the terms of the file say whether there is distortion.
std::optional<CameraModel> model_of_name(std::string_view name);

/// nerfstudio's name of a model.
const char* model_name(CameraModel model);

/// All names that are known, separated by commas.
std::string model_names();

}  // namespace raysplats::io
