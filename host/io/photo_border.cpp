// SPDX-License-Identifier: Apache-2.0
#include "io/photo_border.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/mat2x2.hpp>
#include <glm/matrix.hpp>
#include <glm/vec2.hpp>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <variant>

#include "io/body_outline.hpp"
#include "io/image_codec.hpp"
#include "io/photo_orientation.hpp"
#include "raysplats/error.hpp"
#include "scene/even_choice.hpp"
#include "scene/photo_lens.hpp"
#include "util/parallel.hpp"
#include "util/srgb.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kMostPhotos = 8;
constexpr std::size_t kLeastPhotos = 3;
// The black of videos is 16 of 255, and compression adds to it.
constexpr double kBlack = 24.0 / 255.0;
constexpr int kLeastDepth = 2;
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
// The circle of a fisheye: how far ends may lie off it and how large it is at least, as shares of
// the photo's shorter side, and the share of the ends that lie on it.
constexpr double kMostOffCircle = 0.02;
constexpr double kLeastRadius = 0.4;
constexpr double kLeastOnCircle = 0.8;
// The outline of a body, as a share of its radius: that of rendered turntables misses it by less,
// borders painted into captures by hand that look around by more. And how many points of an edge
// tell.
constexpr double kLeastMisfit = 0.05;
constexpr std::size_t kEdgePoints = 16;
// Folders that photos are told apart by, as several clips lie in.
constexpr std::size_t kMostFolders = 8;
// Of a photo: a vertical video with bars on all sides has less.
constexpr double kMostHidden = 0.85;
// Of what a border hides of a photo: one that shows more there has none.
constexpr double kMostShown = 0.1;

enum Side : std::size_t { kTop, kBottom, kLeft, kRight };
constexpr std::size_t kSides = 4;

// How far a photo is black from each edge, by column or row.
struct Edges {
  int width = 0;
  int height = 0;
  std::array<std::vector<int>, kSides> depths;

  int depth_of(Side side) const { return side == kTop || side == kBottom ? height : width; }
  bool is_black() const {
    const std::vector<int>& columns = depths[kTop];
    return std::all_of(columns.begin(), columns.end(), [&](int depth) { return depth == height; });
  }
};

template <class T>
class DarkPixels {
 public:
  DarkPixels(const RawImage& photo, const std::vector<T>& numbers, bool light)
      : numbers_(numbers),
        width_(static_cast<std::size_t>(photo.width)),
        channels_(static_cast<std::size_t>(photo.channels)),
        colors_(channels_ < 3 ? 1 : 3) {
    if (light) black_ = light_from_display(black_);
    if constexpr (std::is_integral_v<T>)
      black_ *= static_cast<double>(std::numeric_limits<T>::max());
  }
  bool dark(int x, int y) const {
    const std::size_t pixel = static_cast<std::size_t>(y) * width_ + static_cast<std::size_t>(x);
    const T* number = numbers_.data() + pixel * channels_;
    return std::all_of(number, number + colors_, [&](T value) { return value <= black_; });
  }

 private:
  const std::vector<T>& numbers_;
  std::size_t width_, channels_, colors_;
  double black_ = kBlack;
};

template <class T>
Edges edges_of(const RawImage& photo, const std::vector<T>& numbers, bool light) {
  const DarkPixels<T> pixels(photo, numbers, light);
  Edges out{photo.width, photo.height, {}};
  const auto measure = [&](Side side, int count, const auto& dark) {
    out.depths[side].resize(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) {
      int depth = 0;
      while (depth < out.depth_of(side) && dark(i, depth)) ++depth;
      out.depths[side][static_cast<std::size_t>(i)] = depth;
    }
  };
  const int right = photo.width - 1, bottom = photo.height - 1;
  measure(kTop, photo.width, [&](int i, int j) { return pixels.dark(i, j); });
  measure(kBottom, photo.width, [&](int i, int j) { return pixels.dark(i, bottom - j); });
  measure(kLeft, photo.height, [&](int i, int j) { return pixels.dark(j, i); });
  measure(kRight, photo.height, [&](int i, int j) { return pixels.dark(right - j, i); });
  return out;
}

// Whether the numbers of a photo are proportional to light; only floats are.
bool is_light(const RawImage& photo, const View& view) {
  return std::holds_alternative<std::vector<float>>(photo.numbers) &&
         image_codec().photo_colors(view.image_path.string()).light;
}

std::optional<Edges> edges_of(const View& view) {
  try {
    const RawImage photo = read_photo(view).raw;
    const bool light = is_light(photo, view);
    return std::visit([&](const auto& numbers) { return edges_of(photo, numbers, light); },
                      photo.numbers);
  } catch (const Error&) {
    return std::nullopt;  // who needs the photo says what is wrong with it
  }
}

bool is_fisheye(const Camera& photo) {
  return photo.model == CameraModel::kFisheye ||
         (photo.lens && photo.lens->form == PhotoLens::Form::kFisheye);
}

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
  const auto covers = [](int depth) { return depth >= kLeastDepth; };
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
bool is_agreed(const std::vector<int>& depths, std::span<const Edges> photos, Side side, int most) {
  const int slack = 2 + most / 200;
  std::size_t asked = 0, agreed = 0;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    if (depths[i] == most || depths[i] < kLeastDepth) continue;
    asked += photos.size();
    for (const Edges& photo : photos) agreed += photo.depths[side][i] <= depths[i] + slack ? 1 : 0;
  }
  return static_cast<double>(agreed) >= kLeastAgreement * static_cast<double>(asked);
}

// How deep all photos are black on one side, by column or row.
std::vector<int> common_depths(std::span<const Edges> photos, Side side) {
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

// Where something begins behind what is black from the photo's edges.
std::vector<glm::dvec2> ends_of(const Edges& edges) {
  std::vector<glm::dvec2> out;
  const auto add = [&](Side side, const auto& place) {
    for (std::size_t i = 0; i < edges.depths[side].size(); ++i) {
      const int depth = edges.depths[side][i];
      if (depth >= kLeastDepth && depth < edges.depth_of(side))
        out.push_back(place(static_cast<double>(i) + 0.5, static_cast<double>(depth)));
    }
  };
  add(kTop, [](double i, double depth) { return glm::dvec2(i, depth); });
  add(kBottom, [&](double i, double depth) { return glm::dvec2(i, edges.height - depth); });
  add(kLeft, [](double i, double depth) { return glm::dvec2(depth, i); });
  add(kRight, [&](double i, double depth) { return glm::dvec2(edges.width - depth, i); });
  return out;
}

struct Circle {
  glm::dvec2 center{0.0};
  double radius = 0;

  double off(const glm::dvec2& point) const {
    return std::abs(glm::distance(point, center) - radius);
  }
};

// Least squares of |p|^2 = 2 c p + r^2 - |c|^2 (Kasa 1976), about the points' mean.
Circle fitted_circle(std::span<const glm::dvec2> points) {
  glm::dvec2 mean(0.0);
  for (const glm::dvec2& p : points) mean += p / static_cast<double>(points.size());
  glm::dmat2 squares(0.0);
  glm::dvec2 moments(0.0);
  double size = 0;
  for (const glm::dvec2& p : points) {
    const glm::dvec2 d = p - mean;
    squares += glm::outerProduct(d, d);
    moments += d * glm::dot(d, d) / 2.0;
    size += glm::dot(d, d) / static_cast<double>(points.size());
  }
  if (!(std::abs(glm::determinant(squares)) > 0)) return {};
  const glm::dvec2 center = glm::inverse(squares) * moments;
  return {mean + center, std::sqrt(glm::dot(center, center) + size)};
}

// The circle that something is shown in, as that of a fisheye, which a photo may cut.
std::optional<Circle> circle_of(const Edges& edges) {
  std::vector<glm::dvec2> ends = ends_of(edges);
  const double side = std::min(edges.width, edges.height);
  if (static_cast<double>(ends.size()) < kLeastCover * side) return std::nullopt;
  const std::size_t all = ends.size();
  Circle circle = fitted_circle(ends);
  // Once more without what is dark beside it.
  std::erase_if(ends,
                [&](const glm::dvec2& p) { return circle.off(p) > 2 * kMostOffCircle * side; });
  if (ends.size() < 3) return std::nullopt;
  circle = fitted_circle(ends);
  const auto on = std::count_if(ends.begin(), ends.end(), [&](const glm::dvec2& p) {
    return circle.off(p) <= kMostOffCircle * side;
  });
  const double most = std::hypot(edges.width, edges.height);  // larger ones are straight edges
  const bool found = circle.radius >= kLeastRadius * side && circle.radius <= most &&
                     static_cast<double>(on) >= kLeastOnCircle * static_cast<double>(all);
  return found ? std::optional(circle) : std::nullopt;
}

// Whether the circle is that of the lens. Where all cameras see the outline of one ball in it, it
// may be that of a body; fisheyes that look to one side alone are believed.
bool is_of_lens(const Circle& circle, const Edges& edges, std::span<const Camera> cameras) {
  const std::vector<glm::dvec2> ends = ends_of(edges);
  std::vector<EdgePoint> points;
  for (const std::size_t i : even_choice(ends.size(), kEdgePoints))
    points.push_back({ends[i], glm::normalize(circle.center - ends[i])});
  if (outline_misfit(cameras, points, RoundBody::kBall) >= kLeastMisfit) return true;
  return is_fisheye(cameras.front()) && !look_around(cameras);
}

// Points of a side's straight edge, without its ends where these bend.
std::vector<EdgePoint> straight_edge(const Edges& edges, Side side) {
  const std::vector<int>& depths = edges.depths[side];
  const int most = edges.depth_of(side);
  std::vector<int> shown = partly(depths, most);
  if (shown.empty()) return {};
  const auto middle = shown.begin() + static_cast<std::ptrdiff_t>(shown.size() / 2);
  std::nth_element(shown.begin(), middle, shown.end());
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    const bool straight = std::abs(depths[i] - *middle) <= 1 + kMostBend * most;
    if (straight && depths[i] >= kLeastDepth && depths[i] < most) places.push_back(i);
  }
  std::vector<EdgePoint> out;
  for (const std::size_t i : even_choice(places.size(), kEdgePoints)) {
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
bool is_body(const Edges& edges, std::span<const Camera> cameras) {
  const auto outlines = [&](Side one, Side other) {
    std::vector<EdgePoint> points = straight_edge(edges, one);
    const std::vector<EdgePoint> more = straight_edge(edges, other);
    points.insert(points.end(), more.begin(), more.end());
    return outline_misfit(cameras, points, RoundBody::kCylinder) < kLeastMisfit;
  };
  return look_around(cameras) && (outlines(kLeft, kRight) || outlines(kTop, kBottom));
}

bool is_full(const std::vector<int>& depths, int most) {
  return std::find(depths.begin(), depths.end(), most) != depths.end();
}

// What hides the border that photos agree about; empty where a side has none.
std::array<std::vector<int>, kSides> hidden_depths(std::span<const Edges> photos,
                                                   std::span<const Camera> cameras) {
  Edges common{photos.front().width, photos.front().height, {}};
  for (const Side side : {kTop, kBottom, kLeft, kRight})
    common.depths[side] = common_depths(photos, side);
  const std::optional<Circle> round = circle_of(common);
  const bool circle = round && is_of_lens(*round, common, cameras);
  for (const Side side : {kTop, kBottom, kLeft, kRight}) {
    std::vector<int>& depths = common.depths[side];
    const int most = common.depth_of(side);
    const bool border = is_covered(depths, most) && (circle || is_straight(depths, most)) &&
                        is_agreed(depths, photos, side, most);
    if (!border) depths.clear();
  }
  if (!circle && is_body(common, cameras)) return {};
  for (const Side side : {kTop, kBottom, kLeft, kRight}) {
    const int most = common.depth_of(side);
    // Pictures are blurred where a border ends, and dark at the rim of a circle.
    const int margin = 1 + most / (circle ? 200 : 1000);
    for (int& depth : common.depths[side]) {
      if (depth >= kLeastDepth) depth = std::min(depth + margin, most);
    }
  }
  return common.depths;
}

std::shared_ptr<const PhotoBorder> common_border(std::span<const View* const> photos) {
  std::vector<const View*> chosen;
  for (const std::size_t i : even_choice(photos.size(), kMostPhotos)) chosen.push_back(photos[i]);
  std::vector<Edges> edges;
  std::vector<Camera> cameras;
  const auto take = [&](std::optional<Edges> found, const View& view) {
    if (!found || found->is_black()) return;
    edges.push_back(std::move(*found));
    cameras.push_back(view.source_camera);
  };
  // Most captures have no border, which their first photo shows.
  std::size_t first = 0;
  for (; first < chosen.size() && edges.empty(); ++first)
    take(edges_of(*chosen[first]), *chosen[first]);
  const auto may_have = [&](Side side) {
    return is_covered(edges.front().depths[side], edges.front().depth_of(side));
  };
  if (edges.empty()) return nullptr;
  if (!may_have(kTop) && !may_have(kBottom) && !may_have(kLeft) && !may_have(kRight))
    return nullptr;
  std::vector<std::optional<Edges>> others(chosen.size() - first);
  in_parallel(others.size(), [&](std::size_t i) { others[i] = edges_of(*chosen[first + i]); });
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
  const bool light = is_light(photo, view);
  // Without the margin at its end.
  const int margin = 1 + std::max(photo.width, photo.height) / 200;
  PhotoBorder inner = *view.border;
  for (std::vector<int>* depths : {&inner.top, &inner.bottom, &inner.left, &inner.right}) {
    for (int& depth : *depths) depth -= margin;
  }
  std::size_t hidden = 0, shown = 0;
  std::visit(
      [&](const auto& numbers) {
        using Number = typename std::decay_t<decltype(numbers)>::value_type;
        const DarkPixels<Number> pixels(photo, numbers, light);
        for (int y = 0; y < photo.height; ++y) {
          for (int x = 0; x < photo.width; ++x) {
            if (!inner.hides(x, y)) continue;
            ++hidden;
            shown += pixels.dark(x, y) ? 0 : 1;
          }
        }
      },
      photo.numbers);
  return static_cast<double>(shown) <= kMostShown * static_cast<double>(hidden);
}

}  // namespace raysplats::io
