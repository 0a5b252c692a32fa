// SPDX-License-Identifier: Apache-2.0
#include "io/photo_border.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <variant>

#include "io/image_codec.hpp"
#include "io/photo_orientation.hpp"
#include "raysplats/error.hpp"
#include "scene/even_choice.hpp"
#include "scene/photo_lens.hpp"
#include "util/parallel.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kMostPhotos = 8;
constexpr std::size_t kLeastPhotos = 3;
// The black of videos is 16 of 255, and compression adds to it.
constexpr double kBlack = 24.0 / 255.0;
constexpr int kLeastDepth = 2;
// Of the columns or rows that show something, those that a side's border has to cover.
constexpr double kLeastCover = 0.25;
// Of all columns or rows, those that show something: bodies before a black ground are narrower.
constexpr double kLeastShown = 0.5;
// Between its deepest and its least deep column, but for a twelfth at either end, as a share of
// the photo's size; and where black columns beside it are more than the ends of bent edges, which
// windows have and round bodies that fill a photo.
constexpr double kMostBend = 0.1;
constexpr double kMostBendOfWindow = 0.01;
constexpr double kBesideWindow = 0.2;
constexpr std::size_t kBentEnds = 12;
// Of the columns of all photos, those in which something is shown just where the border ends.
constexpr double kLeastAgreement = 0.5;

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
  DarkPixels(const RawImage& photo, const std::vector<T>& numbers)
      : numbers_(numbers),
        width_(static_cast<std::size_t>(photo.width)),
        channels_(static_cast<std::size_t>(photo.channels)),
        colors_(channels_ < 3 ? 1 : 3) {
    if constexpr (std::is_integral_v<T>) black_ *= static_cast<double>(static_cast<T>(-1));
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
Edges edges_of(const RawImage& photo, const std::vector<T>& numbers) {
  const DarkPixels<T> pixels(photo, numbers);
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

std::optional<Edges> edges_of(const View& view) {
  try {
    const RawImage photo = read_photo(view).raw;
    return std::visit([&](const auto& numbers) { return edges_of(photo, numbers); }, photo.numbers);
  } catch (const Error&) {
    return std::nullopt;  // who needs the photo says what is wrong with it
  }
}

bool is_fisheye(const Camera& photo) {
  return photo.model == CameraModel::kFisheye ||
         (photo.lens && photo.lens->form == PhotoLens::Form::kFisheye);
}

// Whether a border may look so, by the depths of a side, of which `most` is all of the photo.
bool is_border(const std::vector<int>& depths, int most, bool bends) {
  std::vector<int> partly;
  for (const int depth : depths) {
    if (depth < most) partly.push_back(depth);
  }
  const auto covers = [](int depth) { return depth >= kLeastDepth; };
  const auto count = static_cast<double>(partly.size());
  const auto covered = static_cast<double>(std::count_if(partly.begin(), partly.end(), covers));
  if (partly.empty() || covered < kLeastCover * count) return false;
  if (bends) return true;
  const auto all = static_cast<double>(depths.size());
  if (count < kLeastShown * all) return false;
  std::sort(partly.begin(), partly.end());
  const std::size_t end = partly.size() / kBentEnds;
  const double bend = partly[partly.size() - 1 - end] - partly[end];
  const bool window = all - count > kBesideWindow * all;
  return bend <= (window ? kMostBendOfWindow * most + 1 : kMostBend * most);
}

// Whether most photos show something just where the border ends.
bool is_agreed(const std::vector<int>& depths, std::span<const Edges> photos, Side side, int most) {
  const int slack = 2 + most / 100;
  std::size_t asked = 0, agreed = 0;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    if (depths[i] == most || depths[i] < kLeastDepth) continue;
    asked += photos.size();
    for (const Edges& photo : photos) agreed += photo.depths[side][i] <= depths[i] + slack ? 1 : 0;
  }
  return static_cast<double>(agreed) >= kLeastAgreement * static_cast<double>(asked);
}

// How deep the border of one side is, by column or row; empty where it has none.
std::vector<int> common_depths(std::span<const Edges> photos, Side side, bool fisheye) {
  const int most = photos.front().depth_of(side);
  std::vector<int> out(photos.front().depths[side].size());
  std::vector<int> found(photos.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    for (std::size_t p = 0; p < photos.size(); ++p) found[p] = photos[p].depths[side][i];
    // One photo of eight may have a speck there.
    const auto least = found.begin() + static_cast<std::ptrdiff_t>(found.size() / kMostPhotos);
    std::nth_element(found.begin(), least, found.end());
    out[i] = *least;
  }
  if (!is_border(out, most, fisheye) || !is_agreed(out, photos, side, most)) return {};
  // Pictures are blurred where a border ends, and dark at the rim of a fisheye.
  const int margin = 1 + most / (fisheye ? 200 : 1000);
  for (int& depth : out) {
    if (depth >= kLeastDepth) depth = std::min(depth + margin, most);
  }
  return out;
}

bool is_full(const std::vector<int>& depths, int most) {
  return std::find(depths.begin(), depths.end(), most) != depths.end();
}

std::shared_ptr<const PhotoBorder> common_border(std::span<const View* const> photos) {
  const bool fisheye = is_fisheye(photos.front()->source_camera);
  std::vector<const View*> chosen;
  for (const std::size_t i : even_choice(photos.size(), kMostPhotos)) chosen.push_back(photos[i]);
  std::vector<Edges> edges;
  const auto tells = [](const std::optional<Edges>& found) { return found && !found->is_black(); };
  // Most captures have no border, which their first photo shows.
  std::size_t first = 0;
  for (; first < chosen.size() && edges.empty(); ++first) {
    if (std::optional<Edges> found = edges_of(*chosen[first]); tells(found))
      edges.push_back(std::move(*found));
  }
  const auto may_have = [&](Side side) {
    return is_border(edges.front().depths[side], edges.front().depth_of(side), fisheye);
  };
  if (edges.empty()) return nullptr;
  if (!may_have(kTop) && !may_have(kBottom) && !may_have(kLeft) && !may_have(kRight))
    return nullptr;
  std::vector<std::optional<Edges>> others(chosen.size() - first);
  in_parallel(others.size(), [&](std::size_t i) { others[i] = edges_of(*chosen[first + i]); });
  for (std::optional<Edges>& found : others) {
    if (tells(found)) edges.push_back(std::move(*found));
  }
  if (edges.size() < kLeastPhotos) return nullptr;
  PhotoBorder border{common_depths(edges, kTop, fisheye), common_depths(edges, kBottom, fisheye),
                     common_depths(edges, kLeft, fisheye), common_depths(edges, kRight, fisheye)};
  const int width = edges.front().width, height = edges.front().height;
  // Rows that are black altogether are of bars above and below, or all of it is a black ground.
  const bool above = !border.top.empty() || !border.bottom.empty();
  const bool beside = !border.left.empty() || !border.right.empty();
  if (!above && (is_full(border.left, width) || is_full(border.right, width))) return nullptr;
  if (!beside && (is_full(border.top, height) || is_full(border.bottom, height))) return nullptr;
  if (!above && !beside) return nullptr;
  border.top.resize(static_cast<std::size_t>(width));
  border.bottom.resize(border.top.size());
  border.left.resize(static_cast<std::size_t>(height));
  border.right.resize(border.left.size());
  return std::make_shared<const PhotoBorder>(std::move(border));
}

}  // namespace

void find_borders(std::vector<View>& views) {
  std::map<std::pair<int, int>, std::vector<const View*>> sizes;
  for (const View& view : views) {
    if (!view.test) sizes[{view.source_camera.width, view.source_camera.height}].push_back(&view);
  }
  for (const auto& [size, photos] : sizes) {
    if (photos.size() < kLeastPhotos) continue;
    const auto border = common_border(photos);
    if (!border) continue;
    for (View& view : views) {
      if (view.source_camera.width == size.first && view.source_camera.height == size.second)
        view.border = border;
    }
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

}  // namespace raysplats::io
