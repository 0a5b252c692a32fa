// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <sstream>
#include <string>
#include <vector>

#include "raysplats/io.hpp"
#include "unit/io/scratch.hpp"

namespace raysplats::test {

/// A COLMAP model as the tests state it, to be written in both of COLMAP's encodings.
struct ColmapFixture {
  struct CameraLine {
    std::uint32_t id;
    int model;
    const char* model_name;
    std::uint64_t width, height;
    std::vector<double> parameters;
  };
  struct ImageLine {
    std::uint32_t id;
    std::array<double, 7> pose;
    std::uint32_t camera;
    std::string name;
    int image_points;
  };
  struct PointLine {
    std::array<double, 3> position;
    std::array<std::uint8_t, 3> color;
  };
  std::vector<CameraLine> cameras;
  std::vector<ImageLine> images;
  std::vector<PointLine> points;

  std::string cameras_binary() const {
    std::string out;
    put<std::uint64_t>(out, cameras.size());
    for (const CameraLine& c : cameras) {
      put(out, c.id);
      put<std::int32_t>(out, c.model);
      put(out, c.width);
      put(out, c.height);
      for (const double p : c.parameters) put(out, p);
    }
    return out;
  }
  std::string images_binary() const {
    std::string out;
    put<std::uint64_t>(out, images.size());
    for (const ImageLine& i : images) {
      put(out, i.id);
      for (const double p : i.pose) put(out, p);
      put(out, i.camera);
      out += i.name;
      out += '\0';
      put<std::uint64_t>(out, static_cast<std::uint64_t>(i.image_points));
      for (int k = 0; k < i.image_points; ++k) {
        put(out, 1.5);
        put(out, 2.5);
        put<std::int64_t>(out, -1);
      }
    }
    return out;
  }
  std::string points_binary() const {
    std::string out;
    put<std::uint64_t>(out, points.size());
    std::uint64_t id = 0;
    for (const PointLine& p : points) {
      put(out, id++);
      for (const double x : p.position) put(out, x);
      for (const std::uint8_t c : p.color) put(out, c);
      put(out, 0.5);
      put<std::uint64_t>(out, 2);
      for (int k = 0; k < 4; ++k) put<std::uint32_t>(out, 1);
    }
    return out;
  }
  std::string cameras_text() const {
    std::ostringstream out;
    out.precision(17);
    out << "# Camera list\n";
    for (const CameraLine& c : cameras) {
      out << c.id << " " << c.model_name << " " << c.width << " " << c.height;
      for (const double p : c.parameters) out << " " << p;
      out << "\n";
    }
    return out.str();
  }
  std::string images_text() const {
    std::ostringstream out;
    out.precision(17);
    out << "# Image list\n\n";
    for (const ImageLine& i : images) {
      out << i.id;
      for (const double p : i.pose) out << " " << p;
      out << " " << i.camera << " " << i.name << "\n";
      for (int k = 0; k < i.image_points; ++k) out << "1.5 2.5 -1 ";
      out << "\n";
    }
    return out.str();
  }
  std::string points_text() const {
    std::ostringstream out;
    out.precision(17);
    std::uint64_t id = 0;
    for (const PointLine& p : points) {
      out << id++;
      for (const double x : p.position) out << " " << x;
      for (const std::uint8_t c : p.color) out << " " << static_cast<int>(c);
      out << " 0.5 1 1 1 1\n";
    }
    return out.str();
  }
  void write_binary(const fs::path& folder) const {
    write_bytes(folder / "cameras.bin", cameras_binary());
    write_bytes(folder / "images.bin", images_binary());
    write_bytes(folder / "points3D.bin", points_binary());
  }
  void write_text(const fs::path& folder) const {
    write_bytes(folder / "cameras.txt", cameras_text());
    write_bytes(folder / "images.txt", images_text());
    write_bytes(folder / "points3D.txt", points_text());
  }
};

/// Three cameras of different models, ten images of which one has no key points, three points.
inline ColmapFixture small_colmap() {
  ColmapFixture fixture;
  fixture.cameras = {{7, 1, "PINHOLE", 40, 30, {50.5, 51.25, 20.25, 14.75}},
                     {9, 2, "SIMPLE_RADIAL", 40, 30, {48, 20, 15, 0.05}},
                     {4, 4, "OPENCV", 40, 30, {47, 46, 19, 16, 0.1, -0.02, 0.003, -0.004}}};
  for (std::uint32_t i = 0; i < 10; ++i) {
    const std::string name = i % 2 == 0 ? "left/" : "";
    fixture.images.push_back({100 - i,
                              {0.9 + 0.01 * i, 0.1, -0.2, 0.05 * i, 0.5, -0.25 * i, 3.125},
                              std::array<std::uint32_t, 3>{7, 9, 4}[i % 3],
                              name + "photo " + std::to_string(9 - i) + ".png",
                              i == 3 ? 0 : 2});
  }
  fixture.points = {
      {{1, 2, 3}, {255, 0, 51}}, {{-1.5, 0, 8}, {0, 102, 255}}, {{0.125, 4, 5}, {1, 2, 3}}};
  return fixture;
}

/// Photos of one colour each for all images of a model.
inline void write_photos(const ColmapFixture& fixture,
                         const fs::path& folder,
                         int width,
                         int height) {
  for (const auto& image : fixture.images) {
    write_image(folder / image.name, Image(width, height, 3, 0.2f));
  }
}

/// JSON of a rigid motion with the camera at (x, 2, 3), turned about the y axis.
inline std::string matrix_json(double x) {
  return "[[0.8, 0, 0.6, " + std::to_string(x) +
         "], [0, 1, 0, 2], [-0.6, 0, 0.8, 3], [0, 0, 0, 1]]";
}

}  // namespace raysplats::test
