// SPDX-License-Identifier: Apache-2.0
#include "io/photo/black_edges.hpp"

#include <algorithm>
#include <limits>
#include <type_traits>
#include <variant>

#include "io/photo/photo_orientation.hpp"
#include "raysplats/error.hpp"
#include "util/srgb.hpp"

namespace raysplats::io {
namespace {

// The black of videos is 16 of 255, and compression adds to it.
constexpr double kBlack = 24.0 / 255.0;

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
BlackEdges edges_of(const RawImage& photo, const std::vector<T>& numbers, bool light) {
  const DarkPixels<T> pixels(photo, numbers, light);
  BlackEdges out{photo.width, photo.height, {}};
  const auto measure = [&](PhotoSide side, int count, const auto& dark) {
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

}  // namespace

bool BlackEdges::is_black() const {
  const std::vector<int>& columns = depths[kTop];
  return std::all_of(columns.begin(), columns.end(), [&](int depth) { return depth == height; });
}

std::vector<glm::dvec2> BlackEdges::ends() const {
  std::vector<glm::dvec2> out;
  const auto add = [&](PhotoSide side, const auto& place) {
    for (std::size_t i = 0; i < depths[side].size(); ++i) {
      const int depth = depths[side][i];
      if (depth >= kLeastBorder && depth < depth_of(side))
        out.push_back(place(static_cast<double>(i) + 0.5, static_cast<double>(depth)));
    }
  };
  add(kTop, [](double i, double depth) { return glm::dvec2(i, depth); });
  add(kBottom, [this](double i, double depth) { return glm::dvec2(i, height - depth); });
  add(kLeft, [](double i, double depth) { return glm::dvec2(depth, i); });
  add(kRight, [this](double i, double depth) { return glm::dvec2(width - depth, i); });
  return out;
}

std::optional<BlackEdges> black_edges(const View& view) {
  try {
    const RawImage photo = read_photo(view).raw;
    const bool light = is_light(photo, view);
    return std::visit([&](const auto& numbers) { return edges_of(photo, numbers, light); },
                      photo.numbers);
  } catch (const Error&) {
    return std::nullopt;
  }
}

double shown_share(const RawImage& photo, const View& view, const PhotoBorder& where) {
  const bool light = is_light(photo, view);
  std::size_t hidden = 0, shown = 0;
  std::visit(
      [&](const auto& numbers) {
        using Number = typename std::decay_t<decltype(numbers)>::value_type;
        const DarkPixels<Number> pixels(photo, numbers, light);
        for (int y = 0; y < photo.height; ++y) {
          for (int x = 0; x < photo.width; ++x) {
            if (!where.hides(x, y)) continue;
            ++hidden;
            shown += pixels.dark(x, y) ? 0 : 1;
          }
        }
      },
      photo.numbers);
  return hidden > 0 ? static_cast<double>(shown) / static_cast<double>(hidden) : 0.0;
}

}  // namespace raysplats::io
