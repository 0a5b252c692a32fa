// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "io/image/image_file.hpp"
#include "raysplats/dataset.hpp"

/// What views of every kind of data set share.
namespace raysplats::io {

/// Sets the cameras of a view: `nominal` is the camera at the size that its model states, the photo
/// may have another (reduced copies, rounding by a pixel) or lie on its side
/// (photo_orientation.hpp), and is used reduced by `factor`. Throws DataError for a photo of
/// another shape.
void set_cameras(View& view, const Camera& nominal, ImageSize photo, double factor, bool undistort);

/// The camera of the picture that is made of a photo, whose camera with its lens is `photo`: of a
/// size divided by `factor`, and with `undistort` a pinhole in the place of kOpenCv.
Camera picture_camera(const Camera& photo, double factor, bool undistort);

void sort_by_name(std::vector<View>& views);

/// Poses without a photo, as those of blurred photos that were deleted, are left out with a
/// warning; where most of `all` have none, it is the folder that is wrong: DataError with `advice`.
void leave_out_missing(std::size_t missing,
                       std::size_t all,
                       const std::string& what,
                       const std::string& advice);

/// Warns once of photos of planes whose lens folds back (lens_limit()) within half of their smaller
/// side: its polynomial does not fit the photo, most of which is lost.
void warn_of_folding_lenses(const std::vector<View>& views);

/// Warns once where the principal points of most photos are far from their middle or beside them:
/// intrinsics of another size than the photos', unless they are crops.
void warn_of_principal_points(const std::vector<View>& views);

/// Throws DataError: two images of `cameras`, a file or model by its name, have one photo.
[[noreturn]] void refuse_shared_photo(const std::string& first,
                                      const std::string& second,
                                      const std::string& cameras,
                                      const std::filesystem::path& photo);

/// Tells of photos that have another extension than the file of cameras says: so many of `all`,
/// `first` as it has it.
void tell_of_extensions(std::size_t reformatted,
                        std::size_t all,
                        const std::filesystem::path& cameras,
                        const std::string& first);

/// Tells of photos whose names another system wrote, to which letter case is all the same, or
/// whether an accent is a character of its own: so many of `all`, `first` as the file of cameras
/// has it.
void tell_of_case(std::size_t respelt,
                  std::size_t all,
                  const std::filesystem::path& cameras,
                  const std::string& first);

}  // namespace raysplats::io
