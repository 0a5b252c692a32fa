// SPDX-License-Identifier: Apache-2.0
#include "report/figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "io/image/image_codec.hpp"
#include "raysplats/error.hpp"
#include "raysplats/image.hpp"
#include "raysplats/io.hpp"
#include "report/html.hpp"

namespace raysplats::report {
namespace {

using Bytes = std::vector<unsigned char>;

constexpr int kPanels = 3;
/// Bytes of all pictures before base64, which adds a third: the page is to stay below 3 MB.
constexpr std::size_t kMostBytes = 1'600'000;

/// How pictures are made, from the best on.
struct Grade {
  int side;  ///< of a panel, in pixels
  int quality;
};
constexpr Grade kGrades[] = {{480, 85}, {480, 65}, {360, 65}, {240, 60}, {160, 50}};

/// How much a pixel of the source counts for one of fewer pixels along a line.
struct Share {
  int from;
  float weight;
};

/// What each of `to` pixels takes of `from`: lengths of overlap, 1 together.
std::vector<std::vector<Share>> shares(int from, int to) {
  std::vector<std::vector<Share>> out(static_cast<std::size_t>(to));
  const double step = static_cast<double>(from) / to;
  for (int i = 0; i < to; ++i) {
    const double begin = i * step, end = begin + step;
    for (int k = static_cast<int>(begin); k < from && k < end; ++k) {
      const double overlap = std::min(end, k + 1.0) - std::max(begin, static_cast<double>(k));
      out[static_cast<std::size_t>(i)].push_back({k, static_cast<float>(overlap / step)});
    }
  }
  return out;
}

/// Averages over areas, so that no panel has a side above `side`. Panels do not mix.
Image shrunk(const Image& image, int side) {
  const int panel = image.width / kPanels;
  const double scale = std::min(1.0, static_cast<double>(side) / std::max(panel, image.height));
  const auto scaled = [&](int length) {
    return std::max(1, static_cast<int>(std::lround(scale * length)));
  };
  Image out(kPanels * scaled(panel), scaled(image.height), image.channels);
  const auto columns = shares(image.width, out.width), rows = shares(image.height, out.height);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      for (const Share& row : rows[static_cast<std::size_t>(y)]) {
        for (const Share& column : columns[static_cast<std::size_t>(x)]) {
          for (int c = 0; c < out.channels; ++c)
            out.at(x, y, c) += row.weight * column.weight * image.at(column.from, row.from, c);
        }
      }
    }
  }
  return out;
}

std::vector<Bytes> encoded(const std::vector<Image>& images, const Grade& grade) {
  io::ImageEncoding encoding;
  encoding.format = "jpeg";
  encoding.quality = grade.quality;
  std::vector<Bytes> out;
  out.reserve(images.size());
  for (const Image& image : images) {
    out.push_back(io::image_codec().encode("picture.jpg", shrunk(image, grade.side), encoding));
  }
  return out;
}

/// At the best grade that fits.
std::vector<Bytes> fitting(const std::vector<Image>& images) {
  std::vector<Bytes> out;
  for (const Grade& grade : kGrades) {
    out = encoded(images, grade);
    std::size_t sum = 0;
    for (const Bytes& bytes : out) sum += bytes.size();
    if (sum <= kMostBytes) break;
  }
  return out;
}

}  // namespace

std::string figures(std::span<const Figure> figures) {
  std::vector<Image> images;
  std::vector<std::string> lacks;  // why a figure has no image, "" for one that has
  for (const Figure& figure : figures) {
    std::string& lack = lacks.emplace_back();
    if (figure.file.empty()) {
      lack = "the run wrote no picture of it (--eval-renders)";
      continue;
    }
    try {
      // Large ones are let go one by one.
      images.push_back(shrunk(read_image(figure.file), kGrades[0].side));
    } catch (const DataError& error) {
      lack = error.what();
    }
  }
  const std::vector<Bytes> bytes = fitting(images);
  std::string out;
  auto next = bytes.begin();
  auto lack = lacks.begin();
  for (const Figure& figure : figures) {
    const std::string caption = escaped(figure.caption), why = escaped(*lack++);
    if (!why.empty()) {
      out += fmt::format("<p>{}: {}.</p>\n", caption, why);
      continue;
    }
    out += fmt::format(
        "<figure><img alt=\"{}\" src=\"{}\"/><figcaption>{} (photo, render, "
        "error)</figcaption></figure>\n",
        escaped(figure.name), data_url("image/jpeg", *next++), caption);
  }
  return out;
}

}  // namespace raysplats::report
