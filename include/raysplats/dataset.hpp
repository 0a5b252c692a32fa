// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"

namespace raysplats {

/// Whose layout of files a data set has.
enum class DatasetKind { kColmap, kBlender, kNerfstudio, kLlff, kPolycam };
/// Which views of a data set: those to train on, those held out, or both.
enum class Split { kTrain, kTest, kAll };

/// What a photo's mask says about the pixels that are black in it.
enum class MaskUse {
  kIgnore,  ///< nothing is known of them: they count neither in training nor in evaluation
  kCutout,  ///< they are background, as the transparent pixels of cut-out photos
};

/// What is transparent in photos.
enum class AlphaUse {
  kAuto,    ///< kCutout where most photos have something transparent, but for holes and a border
            ///< that is the same in all of them; else kIgnore
  kIgnore,  ///< unknown, as what MaskUse::kIgnore ignores
  kCutout,  ///< background: the photos show a body that was cut out
};

/// What counts of black borders that all photos of a data set have.
enum class BorderUse {
  kAuto,  ///< nothing: no more than what MaskUse::kIgnore ignores
  kKeep,  ///< all: they are a part of the scene
};

/// What all photos of a size have along their edges and no scene shows, as the bars of a video: how
/// many pixels of the photo on disk, from each edge.
struct PhotoBorder {
  std::vector<int> top, bottom;  ///< of every column
  std::vector<int> left, right;  ///< of every row

  /// Whether it takes the pixel.
  bool hides(int x, int y) const {
    const auto column = static_cast<std::size_t>(x), row = static_cast<std::size_t>(y);
    const int width = static_cast<int>(top.size()), height = static_cast<int>(left.size());
    return y < top[column] || y >= height - bottom[column] || x < left[row] ||
           x >= width - right[row];
  }
  bool operator==(const PhotoBorder&) const = default;
};

/// A box of a picture, in shares of its width and height from the top left: 0 <= left < right <= 1
/// and 0 <= top < bottom <= 1.
struct PhotoArea {
  double left = 0, top = 0, right = 1, bottom = 1;
  bool operator==(const PhotoArea&) const = default;
};

/// One photo and the camera that took it, at the size it is used (after --downscale).
struct View {
  Camera camera;                     ///< of the picture that load_view_image() gives
  std::filesystem::path image_path;  ///< the photo on disk, possibly distorted and larger
  std::filesystem::path mask_path;   ///< optional mask (black = ignore); empty when there is none
  std::filesystem::path depth_path;  ///< optional depth map (PNG or .npy); empty when there is none
  std::vector<std::uint32_t> points;  ///< numbers of the sparse points that it is known to show
  bool mask_apart = false;  ///< alpha is coverage, and what does not count is a plane of its own
  bool mask_cuts = false;   ///< what the mask leaves out is background (MaskUse::kCutout)
  Camera source_camera;     ///< of the photo on disk, with its lens
  int sample_bytes = 1;     ///< of a number in the photo on disk: 1, 2 or 4 (floats)
  std::shared_ptr<const PhotoBorder> border;  ///< which does not count; null: there is none
  std::vector<PhotoArea> ignored;             ///< of the photo on disk, which do not count either
  bool test = false;                          ///< held out
};

/// Sparse points of a COLMAP model or a PLY named by the data set.
struct PointCloud {
  std::vector<float> positions;              ///< 3 N, world units
  std::vector<float> colors;                 ///< 3 N, in [0, 1]
  std::vector<std::uint32_t> track_lengths;  ///< N photos that show it, or empty
  std::vector<float> errors;                 ///< N reprojection errors in pixels, or empty
  /// Number of points.
  std::size_t size() const { return positions.size() / 3; }
};

/// How a data set is read.
struct DatasetOptions {
  /// By what image sizes are divided; 0 stands for 1, which `train` changes where photos are large.
  /// COLMAP: images_N is used when it exists, the rest is resampled.
  double downscale = 0;
  int test_every = 8;  ///< every n-th view of a data set without a split of its own; 0 = none
  /// Names of the photos that are held out, whatever test_every and the data set's own files say:
  /// that of View::camera, the end of it that no other has, or a path that ends so, the extension
  /// left out or not. What those files hold out besides is left out. No name = none is held out.
  std::optional<std::set<std::string>> test_list = std::nullopt;
  /// true: photos through lenses with distortion (kOpenCv) become pinhole pictures; false: they
  /// keep their pixels and their model. Other models cannot become pinholes without loss and keep
  /// theirs either way; lenses that no ray knows (kPhotoLens) are taken out either way.
  bool undistort = true;
  MaskUse masks = MaskUse::kIgnore;  ///< what black in masks means
  AlphaUse alpha = AlphaUse::kAuto;  ///< what transparent in photos means
  /// What a black border means that all photos have. None is looked for where photos are cut out.
  BorderUse borders = BorderUse::kAuto;
  /// What does not count of any photo, as it is on disk: logos, dates, what a drone shows over its
  /// picture. Not of cut-out photos.
  std::vector<PhotoArea> ignore_areas = {};
  /// What is taken off all positions, finite numbers up to 1e9; none = 0, but a point near the
  /// cameras where the scene lies so far from the origin of its files (surveyed captures) that
  /// single precision would blur it.
  std::optional<std::array<double, 3>> origin;

  /// What sizes are divided by.
  double factor() const { return downscale > 0 ? downscale : 1.0; }
};

/// Photos, cameras and points of one scene. Images stay on disk until load_view_image().
struct Dataset {
  DatasetKind kind = DatasetKind::kColmap;  ///< as found
  std::filesystem::path root;               ///< the folder
  std::vector<View> views;                  ///< sorted by name within a split
  PointCloud points;                        ///< empty where the data set has none
  bool alpha_is_background = false;  ///< RGBA is composited over the background (AlphaUse, or
                                     ///< MaskUse::kCutout), else alpha is a mask
  std::array<double, 3> origin{};    ///< what was taken off all positions of the files
  int test_every = 0;  ///< every n-th view is held out; 0 = a list or files name those, or none is
  std::optional<DatasetOptions> read_as;  ///< by load_dataset(), with the downscale it took

  /// Positions in `views` of those of a split, in their order.
  std::vector<std::size_t> indices(Split split) const;
};

/// The names of a text file that has one in each line, for DatasetOptions::test_list; empty lines
/// and comments (#) are passed over. Throws DataError for a file that cannot be read.
std::set<std::string> read_test_list(const std::filesystem::path& path);

/// Detects the kind of data set (COLMAP, nerfstudio, Blender, LLFF, Polycam) and reads everything
/// but the pixels. A transforms file is read itself, whatever lies beside it; those of Blender
/// stand for their folder. Poses whose photos are missing are left out with a warning where most
/// are there, and training views of photos that are held out too where these are few. Throws
/// UsageError for names of DatasetOptions::test_list that mean no photo, or several, and
/// DataError for a folder that is none, missing images, an unsupported camera model, no views, a
/// mask of another shape than its photo.
Dataset load_dataset(const std::filesystem::path& path, const DatasetOptions& options = {});

/// The photo of a view as RGBA float at camera.width x camera.height: undistorted where
/// view.camera has another model than the photo's lens, resampled (area average). A is the mask
/// or coverage: 1 where the photo is valid, 0 beyond the limit of a lens; RGB is straight (not
/// premultiplied). Numbers of float files count within [0, 1].
Image load_view_image(const View& view);

/// A photo, and how much each of its pixels counts. Of one whose mask is black everywhere none
/// does, unless the mask cuts out.
struct ViewPicture {
  Image rgba;    ///< as load_view_image()
  Image weight;  ///< one channel in [0, 1], or empty where all count alike (!View::mask_apart)
};

/// The photo of a view with what its mask ignores.
ViewPicture load_view_picture(const View& view);

/// RGB of `rgba` over a constant background. Throws UsageError for a picture without pixels, or
/// with more or fewer numbers than it has.
Image composite(const Image& rgba, const float background[3]);

}  // namespace raysplats
