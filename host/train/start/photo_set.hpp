// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdio>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "io/photo/photo.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats {

/// Alpha above which a pixel shows something: mattes that programs make are seldom 0 all over.
constexpr float kLeastAlpha = 0.02f;

/// A reduced photo and the camera that would have taken it.
struct SmallPhoto {
  Camera camera;
  std::shared_ptr<const io::Photo> picture;
  std::array<float, 3> gain{1.0f, 1.0f, 1.0f};  ///< of its colours, in all that is read of it

  /// Colour and alpha of a pixel.
  std::array<float, 4> color(int x, int y) const {
    std::array<float, 4> rgba = picture->at(x, y);
    for (std::size_t c = 0; c < 3; ++c) rgba[c] *= gain[c];
    return rgba;
  }
  /// The pixel that contains the image point, or the one nearest to it.
  glm::ivec2 pixel_of(const glm::dvec2& point) const {
    return {static_cast<int>(std::clamp<double>(point.x, 0, picture->width - 1)),
            static_cast<int>(std::clamp<double>(point.y, 0, picture->height - 1))};
  }
  /// Its colour and alpha.
  glm::dvec4 at(const glm::dvec2& point) const {
    const glm::ivec2 pixel = pixel_of(point);
    const std::array<float, 4> rgba = color(pixel.x, pixel.y);
    return {rgba[0], rgba[1], rgba[2], rgba[3]};
  }
  /// Whether the pixel that contains the image point counts: at least half of it is not masked out.
  bool known(const glm::dvec2& point) const;
  /// Whether the pixel shows a body: it is at least half opaque, or shows something (kLeastAlpha)
  /// with all that is around it, as half-transparent bodies do and outlines do not.
  bool shows_body(int x, int y) const;
  /// Where a world point is seen inside the picture.
  std::optional<glm::dvec2> sees(const glm::dvec3& world) const;
};

/// Where reading photos shows how far it is, once it has taken so long.
struct ReadingProgress {
  std::FILE* stream = nullptr;  ///< null: nowhere
  double after = 2;             ///< seconds
};

/// The photos of some views, reduced so that their longer side has at most `longest` pixels; for
/// what looks at all of them before training begins. Throws the DataError of load_view_image().
std::vector<SmallPhoto> load_small_photos(const Dataset& dataset,
                                          std::span<const std::size_t> views,
                                          int longest,
                                          const ReadingProgress& progress = {});

/// Chooses the gains of photos whose exposure or white balance changes, so that all have the same
/// mean colour, the mean of theirs: a first guess, right where they show much of the same. A photo
/// of which nothing counts keeps its own.
void balance(std::span<SmallPhoto> photos);

/// Mean share of the pixels that show something: alpha at least one half.
double opaque_share(std::span<const SmallPhoto> photos);

/// Mean share of the pixels of cut-out photos that show a body.
double body_share(std::span<const SmallPhoto> photos);

/// Whether a pixel of a photo shows anything, however faint: alpha above 0.
bool shows_anything(std::span<const SmallPhoto> photos);

/// The colour that is least wrong where photos say nothing: one that a fifth of the pixels share to
/// 8 of 256 steps (a studio's ground, a blown-out sky), else the mean colour. Alpha is the weight
/// of a pixel; black when none counts.
std::array<float, 3> typical_color(std::span<const SmallPhoto> photos);

/// The range that the photos' colours take: but for a thousandth at either end, of the channel that
/// has the widest. Of pixels that show something and count; at least a step of 8 bits.
double color_range(std::span<const SmallPhoto> photos);

}  // namespace raysplats
