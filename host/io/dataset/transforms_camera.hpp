// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>

#include "io/dataset/transforms.hpp"
#include "raysplats/camera.hpp"

namespace raysplats::io {

/// The camera of a frame whose photo has the given size; the file's own size scales its intrinsics,
/// and of one focal length or angle alone it makes square pixels.
/// kPhotoLens for FISHEYE624 and for what nerfstudio reads beyond OpenCV's lenses: k4 of planes, p1
/// and p2 of fisheyes, fisheye_crop_radius.
/// Throws DataError when the frame has no focal length or angle (equirectangular frames need none),
/// or only an angle that no plane has.
Camera frame_camera(const TransformsFile& file, std::size_t frame, int width, int height);

/// The keys that tell a camera's model, principal point and distortion; those of kPhotoLens, which
/// no file of ours has, do not tell all.
nlohmann::json lens_keys(const Camera& camera);

}  // namespace raysplats::io
