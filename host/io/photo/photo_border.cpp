// SPDX-License-Identifier: Apache-2.0
#include "io/photo/photo_border.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <glm/vec2.hpp>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "io/photo/black_edges.hpp"
#include "io/photo/body_outline.hpp"
#include "io/photo/border_circle.hpp"
#include "scene/even_choice.hpp"
#include "util/parallel.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kMostPhotos = 8;
constexpr std::size_t kLeastPhotos = 3;
// Of the columns or rows that show something, those that a side's border has to cover.
constexpr double kLeastCover = 0.25;
// Of all columns or rows, those that show something: a vertical video between bars has a third.
constexpr double kLeastShown = 0.25;
// A side is straight but for a twelfth at either end, or bent and narrow, as edges are whose lens
// was taken out; as shares of the photo's size. Bodies that turn have bent or slanted sides.
constexpr double kMostBend = 0.005;
constexpr double kMostBentDepth = 0.07;
constexpr std::size_t kBentEnds = 12;
// Of the columns of all photos, those in which something is shown just where the border ends.
constexpr double kLeastAgreement = 0.6;
// Folders that photos are told apart by, as several clips lie in.
constexpr std::size_t kMostFolders = 8;
// Of a photo: a vertical video with bars on all sides has less.
constexpr double kMostHidden = 0.85;
// Of what a border hides of a photo: one that shows more there has none.
constexpr double kMostShown = 0.1;

// Depths of the columns or rows that show something, of which `most` is all of the photo.
std::vector<int> partly(const std::vector<int>& depths, int most) {
  std::vector<int> out;
  std::copy_if(depths.begin(), depths.end(), std::back_inserter(out),
               [&](int depth) { return depth < most; });
  return out;
}

// Whether so much of a side is black that it may have a border.
bool is_covered(const std::vector<int>& depths, int most) {
  const std::vector<int> shown = partly(depths, most);
  const auto covers = [](int depth) { return depth >= kLeastBorder; };
  const auto covered = static_cast<double>(std::count_if(shown.begin(), shown.end(), covers));
  return !shown.empty() && covered >= kLeastCover * static_cast<double>(shown.size());
}

bool is_straight(const std::vector<int>& depths, int most) {
  std::vector<int> shown = partly(depths, most);
  if (static_cast<double>(shown.size()) < kLeastShown * static_cast<double>(depths.size()))
    return false;
  std::sort(shown.begin(), shown.end());
  const std::size_t end = shown.size() / kBentEnds;
  const int least = shown[end], deepest = shown[shown.size() - 1 - end];
  return deepest - least <= 1 + kMostBend * most || deepest <= kMostBentDepth * most;
}

// Whether most photos show something just where the border ends.
bool is_agreed(const std::vector<int>& depths,
               std::span<const BlackEdges> photos,
               PhotoSide side,
               int most) {
  const int slack = 2 + most / 200;
  std::size_t asked = 0, agreed = 0;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    if (depths[i] == most || depths[i] < kLeastBorder) continue;
    asked += photos.size();
    for (const BlackEdges& photo : photos)
      agreed += photo.depths[side][i] <= depths[i] + slack ? 1 : 0;
  }
  return static_cast<double>(agreed) >= kLeastAgreement * static_cast<double>(asked);
}

// How deep all photos are black on one side, by column or row.
std::vector<int> common_depths(std::span<const BlackEdges> photos, PhotoSide side) {
  std::vector<int> out(photos.front().depths[side].size());
  std::vector<int> found(photos.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    for (std::size_t p = 0; p < photos.size(); ++p) found[p] = photos[p].depths[side][i];
    // One photo of eight may have a speck there.
    const auto least = found.begin() + static_cast<std::ptrdiff_t>(found.size() / kMostPhotos);
    std::nth_element(found.begin(), least, found.end());
    out[i] = *least;
  }
  return out;
}

// Points of a side's straight edge, without its ends where these bend.
std::vector<EdgePoint> straight_edge(const BlackEdges& edges, PhotoSide side) {
  const std::vector<int>& depths = edges.depths[side];
  const int most = edges.depth_of(side);
  std::vector<int> shown = partly(depths, most);
  if (shown.empty()) return {};
  const auto middle = shown.begin() + static_cast<std::ptrdiff_t>(shown.size() / 2);
  std::nth_element(shown.begin(), middle, shown.end());
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    const bool straight = std::abs(depths[i] - *middle) <= 1 + kMostBend * most;
    if (straight && depths[i] >= kLeastBorder && depths[i] < most) places.push_back(i);
  }
  std::vector<EdgePoint> out;
  for (const std::size_t i : even_choice(places.size(), kOutlinePoints)) {
    const double along = static_cast<double>(places[i]) + 0.5;
    const double depth = depths[places[i]];
    const double inward = side == kTop || side == kLeft ? 1.0 : -1.0;
    const double across = inward > 0 ? depth : most - depth;
    if (side == kTop || side == kBottom) {
      out.push_back({{along, across}, {0.0, inward}});
    } else {
      out.push_back({{across, along}, {inward, 0.0}});
    }
  }
  return out;
}

// Whether edges on opposite sides are, for all cameras, the outline of one upright body, as of one
// that turns before a black ground.
bool is_body(const BlackEdges& edges, std::span<const Camera> cameras) {
  const auto outlines = [&](PhotoSide one, PhotoSide other) {
    std::vector<EdgePoint> points = straight_edge(edges, one);
    const std::vector<EdgePoint> more = straight_edge(edges, other);
    points.insert(points.end(), more.begin(), more.end());
    return outline_misfit(cameras, points, RoundBody::kCylinder) < kMostOutlineMisfit;
  };
  return look_around(cameras) && (outlines(kLeft, kRight) || outlines(kTop, kBottom));
}

bool is_full(const std::vector<int>& depths, int most) {
  return std::find(depths.begin(), depths.end(), most) != depths.end();
}

// What hides the border that photos agree about; empty where a side has none.
std::array<std::vector<int>, kPhotoSides> hidden_depths(std::span<const BlackEdges> photos,
                                                        std::span<const Camera> cameras) {
  BlackEdges common{photos.front().width, photos.front().height, {}};
  for (const PhotoSide side : {kTop, kBottom, kLeft, kRight})
    common.depths[side] = common_depths(photos, side);
  const std::optional<Circle> round = circle_of(common);
  const bool circle = round && is_of_lens(*round, common, cameras);
  for (const PhotoSide side : {kTop, kBottom, kLeft, kRight}) {
    std::vector<int>& depths = common.depths[side];
    const int most = common.depth_of(side);
    const bool border = is_covered(depths, most) && (circle || is_straight(depths, most)) &&
                        is_agreed(depths, photos, side, most);
    if (!border) depths.clear();
  }
  if (!circle && is_body(common, cameras)) return {};
  for (const PhotoSide side : {kTop, kBottom, kLeft, kRight}) {
    const int most = common.depth_of(side);
    // Pictures are blurred where a border ends, and dark at the rim of a circle.
    const int margin = 1 + most / (circle ? 200 : 1000);
    for (int& depth : common.depths[side]) {
      if (depth >= kLeastBorder) depth = std::min(depth + margin, most);
    }
  }
  return common.depths;
}

std::shared_ptr<const PhotoBorder> common_border(std::span<const View* const> photos) {
  std::vector<const View*> chosen;
  for (const std::size_t i : even_choice(photos.size(), kMostPhotos)) chosen.push_back(photos[i]);
  std::vector<BlackEdges> edges;
  std::vector<Camera> cameras;
  const auto take = [&](std::optional<BlackEdges> found, const View& view) {
    if (!found || found->is_black()) return;
    edges.push_back(std::move(*found));
    cameras.push_back(view.source_camera);
  };
  // Most captures have no border, which their first photo shows.
  std::size_t first = 0;
  for (; first < chosen.size() && edges.empty(); ++first)
    take(black_edges(*chosen[first]), *chosen[first]);
  const auto may_have = [&](PhotoSide side) {
    return is_covered(edges.front().depths[side], edges.front().depth_of(side));
  };
  if (edges.empty()) return nullptr;
  if (!may_have(kTop) && !may_have(kBottom) && !may_have(kLeft) && !may_have(kRight))
    return nullptr;
  std::vector<std::optional<BlackEdges>> others(chosen.size() - first);
  in_parallel(others.size(), [&](std::size_t i) { others[i] = black_edges(*chosen[first + i]); });
  for (std::size_t i = 0; i < others.size(); ++i) take(std::move(others[i]), *chosen[first + i]);
  if (edges.size() < kLeastPhotos) return nullptr;
  auto [top, bottom, left, right] = hidden_depths(edges, cameras);
  const int width = edges.front().width, height = edges.front().height;
  // Rows that are black altogether are of bars above and below, or all of it is a black ground.
  const bool above = !top.empty() || !bottom.empty(), beside = !left.empty() || !right.empty();
  if (!above && (is_full(left, width) || is_full(right, width))) return nullptr;
  if (!beside && (is_full(top, height) || is_full(bottom, height))) return nullptr;
  if (!above && !beside) return nullptr;
  for (std::vector<int>* columns : {&top, &bottom})
    columns->resize(static_cast<std::size_t>(width));
  for (std::vector<int>* rows : {&left, &right}) rows->resize(static_cast<std::size_t>(height));
  PhotoBorder border{std::move(top), std::move(bottom), std::move(left), std::move(right)};
  if (hidden_share(border) > kMostHidden) return nullptr;
  return std::make_shared<const PhotoBorder>(std::move(border));
}

std::vector<const View*> training_photos(std::span<View* const> photos) {
  std::vector<const View*> out;
  std::copy_if(photos.begin(), photos.end(), std::back_inserter(out),
               [](const View* view) { return !view->test; });
  return out;
}

void set_border(std::span<View* const> photos) {
  const std::vector<const View*> training = training_photos(photos);
  if (training.size() < kLeastPhotos) return;
  const auto border = common_border(training);
  for (View* view : photos) view->border = border;
}

// The photos by their folders, where these are few and tell as much each as all photos would.
std::vector<std::vector<View*>> clips_of(const std::vector<View*>& photos) {
  std::map<std::filesystem::path, std::vector<View*>> folders;
  for (View* view : photos) folders[view->image_path.parent_path()].push_back(view);
  const bool tell = std::all_of(folders.begin(), folders.end(), [](const auto& folder) {
    return training_photos(folder.second).size() >= kMostPhotos;
  });
  if (!tell || folders.size() > kMostFolders) return {photos};
  std::vector<std::vector<View*>> out;
  out.reserve(folders.size());
  for (auto& [folder, clip] : folders) out.push_back(std::move(clip));
  return out;
}

}  // namespace

void find_borders(std::vector<View>& views) {
  std::map<std::pair<int, int>, std::vector<View*>> sizes;
  for (View& view : views)
    sizes[{view.source_camera.width, view.source_camera.height}].push_back(&view);
  for (const auto& [size, photos] : sizes) {
    for (const std::vector<View*>& clip : clips_of(photos)) set_border(clip);
  }
}

double hidden_share(const PhotoBorder& border) {
  const std::size_t width = border.top.size(), height = border.left.size();
  std::size_t hidden = 0;
  for (std::size_t y = 0; y < height; ++y) {
    for (std::size_t x = 0; x < width; ++x)
      hidden += border.hides(static_cast<int>(x), static_cast<int>(y)) ? 1 : 0;
  }
  return static_cast<double>(hidden) / static_cast<double>(width * height);
}

bool has_border(const RawImage& photo, const View& view) {
  if (!view.border) return false;
  // Without the margin at its end.
  const int margin = 1 + std::max(photo.width, photo.height) / 200;
  PhotoBorder inner = *view.border;
  for (std::vector<int>* depths : {&inner.top, &inner.bottom, &inner.left, &inner.right}) {
    for (int& depth : *depths) depth -= margin;
  }
  return shown_share(photo, view, inner) <= kMostShown;
}

}  // namespace raysplats::io
