// SPDX-License-Identifier: Apache-2.0
#include "io/photo/photo_rows.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/ext/vector_int2.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <numbers>
#include <optional>
#include <type_traits>
#include <utility>

#include "scene/camera/camera_model.hpp"
#include "scene/camera/photo_lens.hpp"
#include "util/srgb.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kChannels = 4;

// Labels count the objects of a picture from 0: whole numbers far below the white of their type.
constexpr float kMostLabel = 31.0f;

// A number of a file, of which 1 is white.
float to_float(std::uint8_t value) { return static_cast<float>(value) / 255.0f; }
float to_float(std::uint16_t value) { return static_cast<float>(value) / 65535.0f; }
float to_float(float value) { return value; }

// In [0, 1]; written so that NaN becomes 0.
float clipped(float value) { return value > 0.0f ? std::min(value, 1.0f) : 0.0f; }

template <class T>
float to_unit(T value) {
  return clipped(to_float(value));
}

constexpr bool has_alpha(std::size_t channels) { return channels == 2 || channels == 4; }

template <class T>
class DecodedRows : public PhotoPixels {
 public:
  DecodedRows(const RawImage& image,
              const std::vector<T>& numbers,
              const MaskPlane* mask,
              PhotoColors colors)
      : PhotoPixels(image.width, image.height),
        numbers_(numbers),
        channels_(static_cast<std::size_t>(image.channels)),
        mask_(mask),
        colors_(colors) {}

  void pixel(int x, int y, float* rgba) override {
    const std::size_t index = static_cast<std::size_t>(y) * static_cast<std::size_t>(width()) +
                              static_cast<std::size_t>(x);
    const T* number = numbers_.data() + index * channels_;
    const bool grey = channels_ < 3;
    rgba[3] = has_alpha(channels_) ? to_unit(number[channels_ - 1]) : 1.0f;
    for (std::size_t c = 0; c < 3; ++c) rgba[c] = color(number[grey ? 0 : c], rgba[3]);
    if (mask_ != nullptr) rgba[3] *= mask_->at(x, y, width(), height());
  }
  void row(int y, float* rgba) override {
    if (!std::is_integral_v<T> || mask_ != nullptr || colors_.associated || colors_.light) {
      for (int x = 0; x < width(); ++x, rgba += kChannels) pixel(x, y, rgba);
      return;
    }
    // Nearly all photos: what pixel() gives, fast enough for those of 16 megapixels.
    const T* number = numbers_.data() +
                      static_cast<std::size_t>(y) * static_cast<std::size_t>(width()) * channels_;
    if (channels_ == 1) plain_row<1>(number, rgba);
    if (channels_ == 2) plain_row<2>(number, rgba);
    if (channels_ == 3) plain_row<3>(number, rgba);
    if (channels_ == 4) plain_row<4>(number, rgba);
  }

 private:
  template <std::size_t kOfPixel>
  void plain_row(const T* number, float* rgba) const {
    for (int x = 0; x < width(); ++x, number += kOfPixel, rgba += kChannels) {
      for (std::size_t c = 0; c < 3; ++c) rgba[c] = to_float(number[kOfPixel < 3 ? 0 : c]);
      rgba[3] = has_alpha(kOfPixel) ? to_float(number[kOfPixel - 1]) : 1.0f;
    }
  }
  // Alpha multiplies light, so that it is taken out before the curve.
  float color(T number, float alpha) const {
    float value = to_float(number);
    if (colors_.associated && alpha > 0.0f) value /= alpha;
    if (colors_.light) value = display_from_light(value);
    return clipped(value);
  }

  const std::vector<T>& numbers_;
  std::size_t channels_;
  const MaskPlane* mask_;
  PhotoColors colors_;
};

class BorderedRows : public PhotoPixels {
 public:
  BorderedRows(std::unique_ptr<PhotoPixels> source, std::shared_ptr<const PhotoBorder> border)
      : PhotoPixels(source->width(), source->height()),
        source_(std::move(source)),
        border_(std::move(border)) {}

  void pixel(int x, int y, float* rgba) override {
    source_->pixel(x, y, rgba);
    if (border_->hides(x, y)) rgba[3] = 0.0f;
  }
  void row(int y, float* rgba) override {
    source_->row(y, rgba);
    for (int x = 0; x < width(); ++x, rgba += kChannels) {
      if (border_->hides(x, y)) rgba[3] = 0.0f;
    }
  }

 private:
  std::unique_ptr<PhotoPixels> source_;
  std::shared_ptr<const PhotoBorder> border_;
};

class RowsWithoutAreas : public PhotoPixels {
 public:
  RowsWithoutAreas(std::unique_ptr<PhotoPixels> source, std::span<const PhotoArea> areas)
      : PhotoPixels(source->width(), source->height()), source_(std::move(source)) {
    for (const PhotoArea& area : areas) {
      const auto pixels = [](double share, int side) { return std::clamp(share, 0.0, 1.0) * side; };
      boxes_.push_back(
          {{std::floor(pixels(area.left, width())), std::floor(pixels(area.top, height()))},
           {std::ceil(pixels(area.right, width())), std::ceil(pixels(area.bottom, height()))}});
    }
  }

  void pixel(int x, int y, float* rgba) override {
    source_->pixel(x, y, rgba);
    for (const auto& [low, high] : boxes_) {
      if (x >= low.x && x < high.x && y >= low.y && y < high.y) rgba[3] = 0.0f;
    }
  }
  void row(int y, float* rgba) override {
    source_->row(y, rgba);
    for (const auto& [low, high] : boxes_) {
      if (y < low.y || y >= high.y) continue;
      for (int x = low.x; x < high.x; ++x) rgba[4 * x + 3] = 0.0f;
    }
  }

 private:
  struct Box {
    glm::ivec2 low, high;  // first pixel, and the one behind the last
  };
  std::unique_ptr<PhotoPixels> source_;
  std::vector<Box> boxes_;
};

class MaskRows : public PhotoPixels {
 public:
  MaskRows(const MaskPlane& mask, int width, int height)
      : PhotoPixels(width, height), mask_(mask) {}
  void pixel(int x, int y, float* rgba) override {
    std::fill(rgba, rgba + 3, 1.0f);
    rgba[3] = mask_.at(x, y, width(), height());
  }
  void row(int y, float* rgba) override {
    for (int x = 0; x < width(); ++x, rgba += kChannels) pixel(x, y, rgba);
  }

 private:
  const MaskPlane& mask_;
};

// Writes a sum of alpha-weighted colours as straight colour and alpha.
void store_straight(const std::array<float, kChannels>& sum, float* out) {
  for (std::size_t c = 0; c < 3; ++c) out[c] = sum[3] > 0 ? sum[c] / sum[3] : 0.0f;
  out[3] = sum[3] > 0 ? std::min(sum[3], 1.0f) : 0.0f;
}

class UndistortedRows : public PhotoRows {
 public:
  UndistortedRows(std::unique_ptr<PhotoPixels> source, const Camera& camera)
      : PhotoRows(source->width(), source->height()),
        source_(std::move(source)),
        camera_(camera),
        target_(rendered_camera(camera)),
        limit_(lens_limit(CameraModel::kOpenCv, camera.distortion)) {}

  void row(int y, float* rgba) override {
    for (int x = 0; x < width(); ++x, rgba += kChannels) {
      const std::optional<glm::dvec2> seen =
          place({(x + 0.5 - target_.cx) / target_.fx, (y + 0.5 - target_.cy) / target_.fy});
      const double u = seen ? seen->x * camera_.fx + camera_.cx : -1.0;
      const double v = seen ? seen->y * camera_.fy + camera_.cy : -1.0;
      if (u >= 0 && u <= width() && v >= 0 && v <= height()) {
        interpolate(u, v, rgba);
      } else {
        std::fill(rgba, rgba + kChannels, 0.0f);
      }
    }
  }

 private:
  /// Where the photo shows what the target has at the normalised point p.
  std::optional<glm::dvec2> place(const glm::dvec2& p) const {
    if (!camera_.lens) {
      if (!(glm::dot(p, p) <= limit_ * limit_)) return std::nullopt;
      return distort(camera_.distortion, p);
    }
    if (target_.model == CameraModel::kPinhole) return lens_point(*camera_.lens, {p.x, p.y, 1.0});
    const double angle = glm::length(p);
    if (angle > std::numbers::pi) return std::nullopt;
    const double sine = angle > 0 ? std::sin(angle) / angle : 1.0;
    return lens_point(*camera_.lens, {sine * p.x, sine * p.y, std::cos(angle)});
  }

  void interpolate(double u, double v, float* rgba) {
    // Between the outermost pixel centres and the border the border pixel goes on.
    const double px = std::clamp(u - 0.5, 0.0, width() - 1.0);
    const double py = std::clamp(v - 0.5, 0.0, height() - 1.0);
    const int x0 = std::min(static_cast<int>(px), std::max(width() - 2, 0));
    const int y0 = std::min(static_cast<int>(py), std::max(height() - 2, 0));
    const int x1 = std::min(x0 + 1, width() - 1);
    const int y1 = std::min(y0 + 1, height() - 1);
    const auto wx = static_cast<float>(px - x0);
    const auto wy = static_cast<float>(py - y0);
    std::array<float, kChannels> sum{};
    const auto add = [&](int x, int y, float weight) {
      std::array<float, kChannels> tap{};
      source_->pixel(x, y, tap.data());
      for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * tap[3] * tap[c];
      sum[3] += weight * tap[3];
    };
    add(x0, y0, (1 - wx) * (1 - wy));
    add(x1, y0, wx * (1 - wy));
    add(x0, y1, (1 - wx) * wy);
    add(x1, y1, wx * wy);
    store_straight(sum, rgba);
  }

  std::unique_ptr<PhotoPixels> source_;
  Camera camera_;
  Camera target_;
  double limit_;
};

class SeenRows : public PhotoRows {
 public:
  SeenRows(std::unique_ptr<PhotoRows> source, const Camera& camera)
      : PhotoRows(source->width(), source->height()),
        source_(std::move(source)),
        camera_(camera),
        limit_(radial_image(
            camera.model, camera.distortion, lens_limit(camera.model, camera.distortion))) {}

  void row(int y, float* rgba) override {
    source_->row(y, rgba);
    const double v = (y + 0.5 - camera_.cy) / camera_.fy;
    for (int x = 0; x < width(); ++x) {
      const double u = (x + 0.5 - camera_.cx) / camera_.fx;
      if (u * u + v * v > limit_ * limit_) rgba[kChannels * static_cast<std::size_t>(x) + 3] = 0.0f;
    }
  }

 private:
  std::unique_ptr<PhotoRows> source_;
  Camera camera_;
  double limit_;
};

// Source pixels [first, first + weights.size()) of one target pixel along an axis; the weights sum
// to 1.
struct Span {
  int first = 0;
  std::vector<float> weights;
};

// Parts of 1 / target of a source pixel are whole numbers, so nothing depends on rounding.
std::vector<Span> area_spans(int source, int target) {
  std::vector<Span> spans(static_cast<std::size_t>(target));
  for (std::int64_t i = 0; i < target; ++i) {
    const std::int64_t begin = i * source, end = begin + source;
    Span& span = spans[static_cast<std::size_t>(i)];
    span.first = static_cast<int>(begin / target);
    for (std::int64_t p = span.first; p * target < end; ++p) {
      const std::int64_t overlap = std::min(end, (p + 1) * target) - std::max(begin, p * target);
      span.weights.push_back(static_cast<float>(static_cast<double>(overlap) / source));
    }
  }
  return spans;
}

class ReducedRows : public PhotoRows {
 public:
  ReducedRows(std::unique_ptr<PhotoRows> source, int width, int height)
      : PhotoRows(width, height),
        source_(std::move(source)),
        columns_(area_spans(source_->width(), width)),
        rows_(area_spans(source_->height(), height)),
        pixels_(kChannels * static_cast<std::size_t>(source_->width())),
        sums_(static_cast<std::size_t>(source_->width())) {}

  // Rows are averaged first, so that one row of sums is all the memory there is.
  void row(int y, float* rgba) override {
    std::fill(sums_.begin(), sums_.end(), std::array<float, kChannels>{});
    const Span& span = rows_[static_cast<std::size_t>(y)];
    for (std::size_t k = 0; k < span.weights.size(); ++k) {
      source_->row(span.first + static_cast<int>(k), pixels_.data());
      const float* pixel = pixels_.data();
      for (std::array<float, kChannels>& sum : sums_) {
        const float weight = span.weights[k] * pixel[3];
        for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * pixel[c];
        sum[3] += weight;
        pixel += kChannels;
      }
    }
    for (const Span& column : columns_) {
      std::array<float, kChannels> sum{};
      for (std::size_t k = 0; k < column.weights.size(); ++k) {
        const auto& part = sums_[static_cast<std::size_t>(column.first) + k];
        for (std::size_t c = 0; c < kChannels; ++c) sum[c] += column.weights[k] * part[c];
      }
      store_straight(sum, rgba);
      rgba += kChannels;
    }
  }

 private:
  std::unique_ptr<PhotoRows> source_;
  std::vector<Span> columns_, rows_;
  std::vector<float> pixels_;
  std::vector<std::array<float, kChannels>> sums_;
};

// Whether the numbers, of which 1 is white, are labels in integers up to `white`.
bool are_labels(const std::vector<float>& values, float most, float white) {
  if (most * white < 0.5f || most * white > kMostLabel + 0.5f) return false;
  // Above 1, what has no background is a dark grey: the black of videos is 16.
  if (most * white > 1.5f && *std::min_element(values.begin(), values.end()) > 0.0f) return false;
  return std::all_of(values.begin(), values.end(), [&](float value) {
    const float label = value * white;
    return std::abs(label - std::round(label)) < 1e-3f;
  });
}

// Makes every label above 0 white.
void make_labels_whole(std::vector<float>& values) {
  const float most = values.empty() ? 0.0f : *std::max_element(values.begin(), values.end());
  if (!are_labels(values, most, 255.0f) && !are_labels(values, most, 65535.0f)) return;
  for (float& value : values) value = value > 0.0f ? 1.0f : 0.0f;
}

// Programs that cut out a shape leave black beneath it.
bool shape_is_in_alpha(const std::vector<float>& values, const std::vector<float>& alphas) {
  const auto is_black = [](float value) { return value == 0.0f; };
  return !alphas.empty() && std::all_of(values.begin(), values.end(), is_black) &&
         std::any_of(alphas.begin(), alphas.end(),
                     [&](float alpha) { return alpha != alphas.front(); });
}

}  // namespace

float MaskPlane::at(int x, int y, int photo_width, int photo_height) const {
  // The pixel below the centre of the photo's.
  const auto place = [](int i, int size, int photo_size) {
    return static_cast<std::size_t>((2 * std::int64_t{i} + 1) * size / (2 * photo_size));
  };
  return values[place(y, height, photo_height) * static_cast<std::size_t>(width) +
                place(x, width, photo_width)];
}

MaskPlane mask_plane(const RawImage& mask) {
  MaskPlane out{mask.width, mask.height, {}};
  const auto channels = static_cast<std::size_t>(mask.channels);
  const bool covered = has_alpha(channels);
  const std::size_t colors = covered ? channels - 1 : channels;
  std::vector<float> alphas;
  std::visit(
      [&](const auto& numbers) {
        out.values.reserve(numbers.size() / channels);
        if (covered) alphas.reserve(numbers.size() / channels);
        for (std::size_t i = 0; i < numbers.size(); i += channels) {
          float most = 0.0f;
          for (std::size_t c = 0; c < colors; ++c) most = std::max(most, to_unit(numbers[i + c]));
          out.values.push_back(most);
          if (covered) alphas.push_back(to_unit(numbers[i + colors]));
        }
      },
      mask.numbers);
  if (shape_is_in_alpha(out.values, alphas)) std::fill(out.values.begin(), out.values.end(), 1.0f);
  make_labels_whole(out.values);
  make_labels_whole(alphas);
  for (std::size_t i = 0; i < alphas.size(); ++i) out.values[i] *= alphas[i];
  return out;
}

bool is_black(const RawImage& mask) {
  const auto channels = static_cast<std::size_t>(mask.channels);
  const bool covered = has_alpha(channels);
  const std::size_t colors = covered ? channels - 1 : channels;
  const bool shows = std::visit(
      [&](const auto& numbers) {
        for (std::size_t i = 0; i < numbers.size(); i += channels) {
          if (covered && !(numbers[i + colors] > 0)) continue;
          for (std::size_t c = 0; c < colors; ++c) {
            if (numbers[i + c] > 0) return true;
          }
        }
        return false;
      },
      mask.numbers);
  // Mostly the first pixels tell; only black with alpha needs the whole plane.
  if (shows || !covered) return !shows;
  const std::vector<float> values = mask_plane(mask).values;
  return std::all_of(values.begin(), values.end(), [](float value) { return value == 0.0f; });
}

std::unique_ptr<PhotoPixels> decoded_rows(const RawImage& image,
                                          const MaskPlane* mask,
                                          PhotoColors colors) {
  return std::visit(
      [&](const auto& numbers) -> std::unique_ptr<PhotoPixels> {
        using T = typename std::decay_t<decltype(numbers)>::value_type;
        return std::make_unique<DecodedRows<T>>(image, numbers, mask, colors);
      },
      image.numbers);
}

std::unique_ptr<PhotoPixels> bordered_rows(std::unique_ptr<PhotoPixels> source,
                                           std::shared_ptr<const PhotoBorder> border) {
  return std::make_unique<BorderedRows>(std::move(source), std::move(border));
}

std::unique_ptr<PhotoPixels> rows_without(std::unique_ptr<PhotoPixels> source,
                                          std::span<const PhotoArea> areas) {
  return std::make_unique<RowsWithoutAreas>(std::move(source), areas);
}

std::unique_ptr<PhotoPixels> mask_rows(const MaskPlane& mask, int width, int height) {
  return std::make_unique<MaskRows>(mask, width, height);
}

std::unique_ptr<PhotoRows> undistorted_rows(std::unique_ptr<PhotoPixels> source,
                                            const Camera& camera) {
  return std::make_unique<UndistortedRows>(std::move(source), camera);
}

std::unique_ptr<PhotoRows> seen_rows(std::unique_ptr<PhotoRows> source, const Camera& camera) {
  if (camera.model != CameraModel::kOpenCv && camera.model != CameraModel::kFisheye) return source;
  return std::make_unique<SeenRows>(std::move(source), camera);
}

std::unique_ptr<PhotoRows> reduced_rows(std::unique_ptr<PhotoRows> source, int width, int height) {
  if (width == source->width() && height == source->height()) return source;
  return std::make_unique<ReducedRows>(std::move(source), width, height);
}

}  // namespace raysplats::io
