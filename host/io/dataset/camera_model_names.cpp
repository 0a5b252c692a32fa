// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/camera_model_names.hpp"

#include <algorithm>
#include <array>
#include <cctype>

namespace raysplats::io {
namespace {

struct ModelName {
  const char* name;
  CameraModel model;
};

// The first name of a model is the one that is written. PERSPECTIVE and FISHEYE are what nerfstudio
// calls the kinds of cameras that its OPENCV and OPENCV_FISHEYE are; BROWN_CONRADY and
// KANNALA_BRANDT4 are RealSense's names of the same terms, and COLMAP's fisheyes are those with the
// first terms alone. RealSense's INVERSE_BROWN_CONRADY and MODIFIED_BROWN_CONRADY are other lenses.
constexpr std::array<ModelName, 16> kModelNames{{{"PINHOLE", CameraModel::kPinhole},
                                                 {"SIMPLE_PINHOLE", CameraModel::kPinhole},
                                                 {"SIMPLE_RADIAL", CameraModel::kPinhole},
                                                 {"RADIAL", CameraModel::kPinhole},
                                                 {"OPENCV", CameraModel::kPinhole},
                                                 {"BROWN_CONRADY", CameraModel::kPinhole},
                                                 {"PERSPECTIVE", CameraModel::kPinhole},
                                                 {"OPENCV_FISHEYE", CameraModel::kFisheye},
                                                 {"SIMPLE_RADIAL_FISHEYE", CameraModel::kFisheye},
                                                 {"RADIAL_FISHEYE", CameraModel::kFisheye},
                                                 {"KANNALA_BRANDT", CameraModel::kFisheye},
                                                 {"KANNALA_BRANDT4", CameraModel::kFisheye},
                                                 {"FISHEYE", CameraModel::kFisheye},
                                                 {"FISHEYE624", CameraModel::kPhotoLens},
                                                 {"EQUIRECTANGULAR", CameraModel::kEquirectangular},
                                                 {"ORTHOPHOTO", CameraModel::kOrthographic}}};

bool same_name(std::string_view a, std::string_view b) {
  const auto plain = [](std::string_view name) {
    std::string out;
    for (const char c : name) {
      if (c != '_' && c != '-' && c != ' ')
        out += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    }
    return out;
  };
  return plain(a) == plain(b);
}

}  // namespace

std::optional<CameraModel> model_of_name(std::string_view name) {
  for (const ModelName& known : kModelNames) {
    if (same_name(known.name, name)) return known.model;
  }
  return std::nullopt;
}

const char* model_name(CameraModel model) {
  if (model == CameraModel::kOpenCv) return "OPENCV";
  return std::find_if(kModelNames.begin(), kModelNames.end(),
                      [&](const ModelName& known) { return known.model == model; })
      ->name;
}

std::string model_names() {
  std::string out;
  for (const ModelName& known : kModelNames) {
    if (!out.empty()) out += ", ";
    out += known.name;
  }
  return out;
}

}  // namespace raysplats::io
