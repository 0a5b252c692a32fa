// SPDX-License-Identifier: Apache-2.0
#include "trace/lens_tiles.hpp"

#include <algorithm>
#include <limits>

#include "trace/camera_rays.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "trace/lens_tiles.cl";
constexpr std::size_t kGroup = 64;
// Least cosine of a ray to its face's axis: beyond, the tangent plane stretches too much.
constexpr float kLeastCosine = 0.15f;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Right, down and forward of every face in camera axes.
constexpr RsLensFaces kFaces{{{1, 0, 0, 0, 1, 0, 0, 0, 1},
                              {0, 0, -1, 0, 1, 0, 1, 0, 0},
                              {0, 0, 1, 0, 1, 0, -1, 0, 0},
                              {1, 0, 0, 0, 0, -1, 0, 1, 0},
                              {1, 0, 0, 0, 0, 1, 0, -1, 0},
                              {-1, 0, 0, 0, 1, 0, 0, 0, -1}}};

bool same_lens(const Camera& a, const Camera& b) {
  return a.model == b.model && a.width == b.width && a.height == b.height && a.fx == b.fx &&
         a.fy == b.fy && a.cx == b.cx && a.cy == b.cy && a.distortion == b.distortion;
}

void grow(std::array<float, 4>& box, const RsLensTile& tile) {
  box[0] = std::min(box[0], tile.x0);
  box[1] = std::min(box[1], tile.y0);
  box[2] = std::max(box[2], tile.x1);
  box[3] = std::max(box[3], tile.y1);
}

}  // namespace

LensTiles::LensTiles(Context& context, int tile_size) : context_(&context), tile_size_(tile_size) {}

glm::dmat3 LensTiles::rotation(int face) {
  const auto& rows = kFaces.rows[face];
  glm::dmat3 out;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      out[column][row] = static_cast<double>(rows[3 * row + column]);
  }
  return out;
}

bool LensTiles::prepare(const Camera& camera) {
  if (camera_ && same_lens(*camera_, camera)) return served_;
  camera_.reset();
  const auto width = static_cast<std::size_t>(camera.width);
  const auto height = static_cast<std::size_t>(camera.height);
  const auto tile = static_cast<std::size_t>(tile_size_);
  tiles_x_ = (width + tile - 1) / tile;
  const std::size_t count = tiles_x_ * ((height + tile - 1) / tile);
  tangents_.ensure(*context_, 3 * width * height, "directions of a lens");
  tiles_.ensure(*context_, count, "tiles of a lens");
  const BuildOptions build = BuildOptions()
                                 .define("CAMERA_MODEL", camera_model_number(camera.model))
                                 .define("TILE", tile_size_);
  // What a lens of the OpenCV model sees lies in front of it.
  const std::int32_t faces = camera.model == CameraModel::kOpenCv ? 1 : RS_FACES;
  context_->kernel(kProgram, "lens_directions", build)
      .launch(Range::linear(width * height, kGroup), lens_camera(camera, Lens{}), tangents_);
  context_->kernel(kProgram, "lens_tiles", build)
      .launch(Range::linear(count, kGroup), camera.width, camera.height, faces, kFaces, tangents_,
              tiles_);
  find_windows(tiles_.download());
  camera_ = camera;
  return served_;
}

void LensTiles::find_windows(const std::vector<RsLensTile>& tiles) {
  constexpr std::array<float, 4> kEmpty{kInfinity, kInfinity, -kInfinity, -kInfinity};
  const std::size_t rows = tiles.size() / tiles_x_;
  windows_.fill(kEmpty);
  std::array<std::vector<std::array<float, 4>>, RS_FACES> spans;
  spans.fill(std::vector<std::array<float, 4>>(rows + tiles_x_, kEmpty));
  std::array<bool, RS_FACES> used{};
  served_ = true;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const RsLensTile& tile = tiles[i];
    const auto face = static_cast<std::size_t>(tile.face);
    used[face] = true;
    served_ = served_ && tile.cosine >= kLeastCosine;
    grow(windows_[face], tile);
    grow(spans[face][i / tiles_x_], tile);
    grow(spans[face][rows + i % tiles_x_], tile);
  }
  faces_.clear();
  for (std::size_t face = 0; face < RS_FACES; ++face) {
    if (!used[face]) continue;
    faces_.push_back(static_cast<int>(face));
    spans_[face].ensure(*context_, rows + tiles_x_, "tiles of a face");
    spans_[face].upload(spans[face]);
  }
}

}  // namespace raysplats
