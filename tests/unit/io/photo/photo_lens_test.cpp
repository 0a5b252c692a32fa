// SPDX-License-Identifier: Apache-2.0
#include "scene/camera/photo_lens.hpp"

#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

#include "io/dataset/colmap_model.hpp"
#include "io/dataset/transforms.hpp"
#include "io/dataset/transforms_camera.hpp"
#include "io/photo/depth_map.hpp"
#include "raysplats/dataset.hpp"
#include "scene/camera/camera_model.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/log_capture.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

using Numbers = std::vector<double>;
using Forward = std::function<glm::dvec2(const Numbers&, const glm::dvec3&)>;

/// x and y of Brown's decentring as OpenCV orders it, at (x, y).
glm::dvec2 brown(double x, double y, double p1, double p2) {
  const double r2 = x * x + y * y;
  return {2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

/// The forward models of COLMAP's documentation, from the parameters of its files to pixels.
glm::dvec2 pixel(const Numbers& p, double x, double y) {
  return {p[0] * x + p[2], p[1] * y + p[3]};
}

glm::dvec2 fov(const Numbers& p, const glm::dvec3& d) {
  const double r = std::hypot(d.x / d.z, d.y / d.z);
  const double scale = std::atan(2 * r * std::tan(p[4] / 2)) / (p[4] * r);
  return pixel(p, scale * d.x / d.z, scale * d.y / d.z);
}

glm::dvec2 full_opencv(const Numbers& p, const glm::dvec3& d) {
  const double x = d.x / d.z, y = d.y / d.z, s = x * x + y * y;
  const double radial = (1 + p[4] * s + p[5] * s * s + p[8] * s * s * s) /
                        (1 + p[9] * s + p[10] * s * s + p[11] * s * s * s);
  const glm::dvec2 more = brown(x, y, p[6], p[7]);
  return pixel(p, x * radial + more.x, y * radial + more.y);
}

glm::dvec2 thin_prism(const Numbers& p, const glm::dvec3& d) {
  const double r = std::hypot(d.x, d.y), t = std::atan2(r, d.z);
  const double u = t * d.x / r, v = t * d.y / r, s = t * t;
  const double radial = 1 + s * (p[4] + s * (p[5] + s * (p[8] + s * p[9])));
  const glm::dvec2 more = brown(u, v, p[6], p[7]);
  return pixel(p, u * radial + more.x + p[10] * s, v * radial + more.y + p[11] * s);
}

glm::dvec2 aria(const Numbers& p, const glm::dvec3& d) {
  const double r = std::hypot(d.x, d.y), t = std::atan2(r, d.z);
  double radial = 1;
  for (std::size_t k = 0; k < 6; ++k) radial += p[4 + k] * std::pow(t, 2.0 * double(k) + 2.0);
  const double x = radial * t * d.x / r, y = radial * t * d.y / r;
  const double r2 = x * x + y * y, dot = 2 * (x * p[10] + y * p[11]);
  return pixel(p, x + dot * x + r2 * p[10] + p[12] * r2 + p[13] * r2 * r2,
               y + dot * y + r2 * p[11] + p[14] * r2 + p[15] * r2 * r2);
}

glm::dvec2 division(const Numbers& p, const glm::dvec3& d) {
  const double rho2 = d.x * d.x + d.y * d.y;
  const double r = 2 / (d.z + std::sqrt(d.z * d.z - 4 * rho2 * p[4]));
  return pixel(p, r * d.x, r * d.y);
}

glm::dvec2 simple_division(const Numbers& p, const glm::dvec3& d) {
  return division({p[0], p[0], p[1], p[2], p[3]}, d);
}

glm::dvec2 eucm(const Numbers& p, const glm::dvec3& d) {
  const double rho = std::sqrt(p[5] * (d.x * d.x + d.y * d.y) + d.z * d.z);
  const double below = p[4] * rho + (1 - p[4]) * d.z;
  return pixel(p, d.x / below, d.y / below);
}

struct LensCase {
  int model;
  const char* name;
  Numbers parameters;
  Forward forward;
  double widest;       ///< angle of the directions that are tried
  CameraModel target;  ///< of the pictures that loading makes
};

/// Lenses for photos of 160 x 120 pixels.
std::vector<LensCase> lenses() {
  constexpr CameraModel kFlat = CameraModel::kPinhole, kWide = CameraModel::kFisheye;
  return {
      {7, "FOV", {120, 121, 81, 59, 0.8}, fov, 0.7, kFlat},
      {7, "FOV", {60, 61, 81, 59, -1.1}, fov, 1.2, kWide},
      {7, "FOV", {160, 161, 81, 59, 1e-5}, fov, 0.4, kFlat},
      {6,
       "FULL_OPENCV",
       {130, 131, 79, 61, 0.2, -0.1, 0.002, -0.003, 0.02, 0.1, 0.05, 0.01},
       full_opencv,
       0.6,
       kFlat},
      {10,
       "THIN_PRISM_FISHEYE",
       {80, 81, 78.5, 60.25, -0.02, 0.01, 0.001, -0.002, 0.003, -0.001, 0.002, -0.003},
       thin_prism,
       1.2,
       kWide},
      {11,
       "RAD_TAN_THIN_PRISM_FISHEYE",
       {70, 70, 80.5, 59.5, 0.39, -0.42, -0.13, 0.55, -0.33, 0.062, -0.0004, 0.0006, 0.0008,
        -0.0001, -0.0005, 0.0001},
       aria,
       1.2,
       kWide},
      {12, "SIMPLE_DIVISION", {110, 80, 60, -0.2}, simple_division, 0.8, kWide},
      {13, "DIVISION", {150, 152, 80, 60, -0.1}, division, 0.6, kFlat},
      {16, "EUCM", {70, 71, 80, 60, 0.6, 1.1}, eucm, 1.3, kWide},
  };
}

ColmapFixture one_camera(const LensCase& lens, const Numbers& parameters) {
  ColmapFixture fixture;
  fixture.cameras = {{3, lens.model, lens.name, 160, 120, parameters}};
  fixture.images = {{1, {1, 0, 0, 0, 0, 0, 0}, 3, "a.png", 0}};
  fixture.points = {{{0, 0, 1}, {0, 0, 0}}};
  return fixture;
}

glm::dvec3 towards(double angle, double around) {
  return {std::sin(angle) * std::cos(around), std::sin(angle) * std::sin(around), std::cos(angle)};
}

/// A photo of 160 x 120 pixels of 16 bits whose colours say where they are: red across, green down.
void write_places(const fs::path& path) {
  std::vector<std::uint16_t> numbers;
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) {
      numbers.push_back(static_cast<std::uint16_t>(std::lround((x + 0.5) * 400)));
      numbers.push_back(static_cast<std::uint16_t>(std::lround((y + 0.5) * 400)));
      numbers.push_back(0);
    }
  }
  fs::create_directories(path.parent_path());
  const auto output = OIIO::ImageOutput::create(path.string());
  REQUIRE(output);
  REQUIRE(output->open(path.string(), OIIO::ImageSpec(160, 120, 3, OIIO::TypeDesc::UINT16)));
  REQUIRE(output->write_image(OIIO::TypeDesc::UINT16, numbers.data()));
  REQUIRE(output->close());
}

}  // namespace

TEST_CASE("photo lenses of COLMAP project as its documentation says, and back") {
  const Scratch scratch;
  for (const LensCase& lens : lenses()) {
    CAPTURE(std::string(lens.name));
    const ColmapFixture fixture = one_camera(lens, lens.parameters);
    fixture.write_binary(scratch / "binary");
    fixture.write_text(scratch / "text");
    for (const char* folder : {"binary", "text"}) {
      const Camera camera = io::read_colmap_model(scratch / folder).cameras.at(3);
      REQUIRE(camera.model == CameraModel::kPhotoLens);
      CounterRng rng(8, 1);
      double worst = 0, worst_back = 0;
      for (int i = 0; i < 500; ++i) {
        const glm::dvec3 direction =
            towards(lens.widest * (0.002 + 0.998 * rng.uniform()), 7 * rng.uniform());
        const auto seen = project(camera, 2.5 * direction);
        REQUIRE(seen);
        worst = std::max(worst, glm::distance(*seen, lens.forward(lens.parameters, direction)));
        const CameraRay ray = camera_ray(camera, seen->x, seen->y);
        REQUIRE(ray.valid);
        worst_back = std::max(worst_back, glm::distance(ray.direction, direction));
      }
      CHECK(worst < 1e-9);
      CHECK(worst_back < 1e-9);
    }
  }
}

TEST_CASE(
    "photos, masks and depth maps through lenses that no ray knows become pictures of others") {
  for (const LensCase& lens : lenses()) {
    CAPTURE(std::string(lens.name));
    const Scratch scratch;
    one_camera(lens, lens.parameters).write_binary(scratch / "sparse/0");
    write_places(scratch / "images/a.png");
    // The mask leaves the left half, depths tell the column of the photo.
    Image mask(160, 120, 1, 0.0f);
    for (int y = 0; y < 120; ++y)
      for (int x = 0; x < 80; ++x) mask.at(x, y, 0) = 1.0f;
    write_image(scratch / "masks/a.png", mask);
    Image depth(160, 120, 1);
    for (int y = 0; y < 120; ++y)
      for (int x = 0; x < 160; ++x) depth.at(x, y, 0) = 2.0f + static_cast<float>(x);
    write_image(scratch / "depth.exr", depth);
    for (const bool undistort : {true, false}) {
      DatasetOptions options;
      options.undistort = undistort;
      Dataset dataset = load_dataset(scratch.path(), options);
      View view = dataset.views.front();
      const Camera& camera = view.camera;
      CHECK(camera.model == lens.target);
      CHECK(!camera.lens);
      CHECK(!camera.distortion.any());
      CHECK(camera.width == 160);
      const Image masked = load_view_image(view);
      view.mask_path.clear();
      const Image image = load_view_image(view);
      view.depth_path = scratch / "depth.exr";
      const io::DepthMap depths = io::view_depths(dataset, view, 1.0);
      const bool along_ray = lens.target == CameraModel::kFisheye;
      const bool turned = along_ray && view.source_camera.lens->form != PhotoLens::Form::kFisheye;
      std::size_t wrong = 0, wrong_mask = 0, known = 0;
      double worst = 0;
      for (int y = 0; y < 120; ++y) {
        for (int x = 0; x < 160; ++x) {
          const CameraRay ray = camera_ray(camera, x + 0.5, y + 0.5);
          if (!ray.valid || std::acos(ray.direction.z) > lens.widest) continue;
          const glm::dvec2 at =
              lens.forward(lens.parameters, ray.direction + glm::dvec3(1e-12, 0, 0));
          const double here = static_cast<double>(
              depths.values[static_cast<std::size_t>(y) * 160 + static_cast<std::size_t>(x)]);
          if (at.x < 0 || at.y < 0 || at.x > 160 || at.y > 120) {
            wrong += here > 0 || image.at(x, y, 3) > 0 ? 1 : 0;
            continue;
          }
          ++known;
          wrong += image.at(x, y, 3) > 0.9999f ? 0 : 1;
          const double expected = (2 + std::floor(at.x)) / (turned ? ray.direction.z : 1.0);
          const bool edge = std::abs(at.x - std::round(at.x)) < 1e-6;
          wrong += edge || std::abs(here - expected) < 1e-4 * expected ? 0 : 1;
          if (std::abs(at.x - 80) > 1.5)
            wrong_mask += (masked.at(x, y, 3) > 0.5f) == (at.x < 80) ? 0 : 1;
          if (at.x < 0.5 || at.y < 0.5 || at.x > 159.5 || at.y > 119.5) continue;
          const glm::dvec2 shown =
              glm::dvec2(image.at(x, y, 0), image.at(x, y, 1)) * 65535.0 / 400.0;
          worst = std::max(worst, glm::distance(shown, at));
        }
      }
      CHECK(known > 10000);
      CHECK(wrong == 0);
      CHECK(wrong_mask == 0);
      CHECK(worst < 0.005);  // pixels: the numbers of the photo are rounded to 1/400
    }
  }
}

TEST_CASE("a wide picture sees what the photo does in its farthest corner") {
  const Scratch scratch;
  for (const LensCase& lens : lenses()) {
    if (lens.target != CameraModel::kFisheye) continue;
    CAPTURE(std::string(lens.name));
    one_camera(lens, lens.parameters).write_binary(scratch / lens.name);
    const Camera photo = io::read_colmap_model(scratch / lens.name).cameras.at(3);
    const Camera camera = rendered_camera(photo);
    // Without what is decentred, rings stay rings.
    PhotoLens plain = *photo.lens;
    plain.p1 = plain.p2 = 0;
    plain.prism = {};
    const auto edge = lens_direction(plain, {image_reach(photo), 0});
    if (edge) {
      CHECK(image_reach(camera) == doctest::Approx(std::acos(edge->z)).epsilon(1e-6));
    } else {
      CHECK(image_reach(camera) > plain.limit);  // the corner is black in the photo
    }
  }
}

TEST_CASE("lenses that cannot be inverted are refused by one sentence") {
  const Scratch scratch;
  const auto error_of = [&](int model, const char* name, const Numbers& parameters) {
    one_camera({model, name, {}, {}, 0, CameraModel::kPinhole}, parameters)
        .write_binary(scratch / "bad");
    std::string message = data_error([&] { io::read_colmap_model(scratch / "bad"); });
    CHECK(message.find('\n') == std::string::npos);
    CHECK(contains(message, "cameras.bin: the camera 3 (" + std::string(name) + ")"));
    return message;
  };
  CHECK(contains(error_of(7, "FOV", {60, 60, 80, 60, 3.2}), "omega 3.2"));
  CHECK(contains(error_of(7, "FOV", {60, 60, 80, 60, -4}), "omega -4"));
  CHECK(contains(error_of(16, "EUCM", {60, 60, 80, 60, 1.2, 1}), "alpha 1.2"));
  const std::string several = "several directions in one place";
  Numbers prism{80, 80, 80, 60, 0, 0, 0, 0, 0, 0, 2.0, 0};
  CHECK(contains(error_of(10, "THIN_PRISM_FISHEYE", prism), several));
  CHECK(contains(error_of(10, "THIN_PRISM_FISHEYE", {80, 80, 80, 60, -1e9, 0, 0, 0, 0, 0, 0, 0}),
                 several));
  const Numbers tangential{60, 60, 80, 60, 0, 0, 0.15, 0, 0, 0, 0, 0};  // folds at two thirds
  CHECK(contains(error_of(10, "THIN_PRISM_FISHEYE", tangential), several));
  // A lens that ends within the photo leaves its corners unknown.
  const LensCase ends{
      10, "THIN_PRISM_FISHEYE", {80, 80, 80, 60, -0.4, 0, 0, 0, 0, 0, 0, 0}, thin_prism,
      0,  CameraModel::kFisheye};
  one_camera(ends, ends.parameters).write_binary(scratch / "ends/sparse/0");
  write_image(scratch / "ends/images/a.png", Image(160, 120, 3, 0.5f));
  const Image image = load_view_image(load_dataset(scratch / "ends").views.front());
  CHECK(image.at(80, 60, 3) == 1.0f);
  CHECK(image.at(0, 0, 3) == 0.0f);
}

TEST_CASE("circular fisheyes to which something is added end a little before their fold") {
  Camera camera;
  camera.width = 90;
  camera.height = 70;
  camera.fx = 25;
  camera.fy = 26;
  camera.cx = 43.5;
  camera.cy = 34.2;
  PhotoLens plain;
  plain.form = PhotoLens::Form::kFisheye;
  plain.radial[0] = -0.05;
  const double fold = std::sqrt(1 / 0.15);
  for (const double p : {0.0, 3e-4, 1e-3, 3e-3}) {
    for (int kind = 0; kind < 4; ++kind) {
      CAPTURE(p);
      CAPTURE(kind);
      PhotoLens lens = plain;
      if (kind == 0) lens.p1 = p;
      if (kind == 1) lens.p2 = p;
      if (kind == 2) lens.prism = {p, 0, -p, 0};
      if (kind == 3) lens.p1 = p;
      lens.decentred_last = kind == 3;
      set_photo_lens(camera, lens, "the camera");
      const PhotoLens& got = *camera.lens;
      CHECK(got.limit > 0.97 * fold);
      CHECK(got.limit < fold);
      std::size_t lost = 0;
      double worst = 0;
      for (int i = 1; i <= 100; ++i) {
        for (int way = 0; way < 40; ++way) {
          const glm::dvec3 direction = towards(0.9999 * got.limit * i / 100, 0.157 * way);
          const auto seen = lens_point(got, direction);
          REQUIRE(seen);
          const auto back = lens_direction(got, *seen);
          lost += back ? 0 : 1;
          if (back) worst = std::max(worst, glm::distance(*back, direction));
        }
      }
      CHECK(lost == 0);
      CHECK(worst < 1e-6);
    }
  }
}

TEST_CASE("one warning counts the photos whose lens folds back well within them") {
  const auto said = [](int model, const char* name, const Numbers& parameters) {
    const Scratch scratch;
    ColmapFixture fixture = one_camera({model, name, {}, {}, 0, CameraModel::kPinhole}, parameters);
    fixture.cameras.front().width = 90;
    fixture.cameras.front().height = 70;
    fixture.images.push_back({2, {1, 0, 0, 0, 0, 0, 1}, 3, "b.png", 0});
    fixture.write_binary(scratch / "sparse/0");
    write_photos(fixture, scratch / "images", 90, 70);
    const LogCapture log;
    load_dataset(scratch.path());
    CHECK(log.contains("fold back") == log.contains("lenses of 2 of 2 photos"));
    // The circle has a radius of 21.8 pixels.
    CHECK(log.contains("fold back") == log.contains("76 %"));
    return log.contains("fold back");
  };
  CHECK(said(2, "SIMPLE_RADIAL", {40, 45, 35, -0.5}));
  CHECK(said(3, "RADIAL", {40, 45, 35, -0.5, 0}));
  CHECK(said(4, "OPENCV", {40, 40, 45, 35, -0.5, 0, 0.001, 0}));
  CHECK(said(6, "FULL_OPENCV", {40, 40, 45, 35, -0.5, 0, 0, 0, 0, 1e-6, 0, 0}));
  CHECK(!said(2, "SIMPLE_RADIAL", {40, 45, 35, -0.1}));
  CHECK(!said(2, "SIMPLE_RADIAL", {40, 45, 35, 0.5}));
  // The circle of a fisheye may lie within the photo.
  CHECK(!said(8, "SIMPLE_RADIAL_FISHEYE", {20, 45, 35, -0.2}));
}

TEST_CASE("nerfstudio's FISHEYE624, k4 of planes, decentred fisheyes and crops") {
  const Scratch scratch;
  const auto camera_of = [&](const std::string& keys) {
    write_bytes(scratch / "transforms.json",
                "{\"w\": 160, \"h\": 120, \"fl_x\": 70, \"cx\": 80.5, \"cy\": 59.5, " + keys +
                    ", \"frames\": [{\"file_path\": \"a.png\", \"transform_matrix\": [[1,0,0,0],"
                    "[0,-1,0,0],[0,0,-1,0],[0,0,0,1]]}]}");
    return io::frame_camera(io::read_transforms(scratch / "transforms.json"), 0, 320, 240);
  };
  const auto compare = [&](const Camera& camera, const Numbers& p, const Forward& forward) {
    REQUIRE(camera.model == CameraModel::kPhotoLens);
    for (int i = 0; i < 60; ++i) {
      const glm::dvec3 direction = towards(0.01 + 0.012 * i, 0.5 * i);
      const auto seen = project(camera, direction);
      REQUIRE(seen);
      CHECK(glm::distance(*seen, 2.0 * forward(p, direction)) < 1e-9);
    }
  };
  const Numbers p{70,    70,    80.5,  59.5,   0.3,   -0.2,  0.1,    0.05,
                  -0.03, 0.002, 0.001, -0.002, 0.003, 0.001, -0.001, 0.002};
  std::string twelve;
  for (std::size_t i = 4; i < p.size(); ++i)
    twelve += (twelve.empty() ? "" : ", ") + std::to_string(p[i]);
  const std::string aria_keys =
      "\"camera_model\": \"FISHEYE624\", \"distortion_params\": [" + twelve + "]";
  compare(camera_of(aria_keys), p, aria);
  // The crop is in pixels of the file.
  const Camera cropped = camera_of(aria_keys + ", \"fisheye_crop_radius\": 40");
  const auto edge = lens_point(*cropped.lens, towards(cropped.lens->limit - 1e-9, 0));
  REQUIRE(edge);
  CHECK(edge->x == doctest::Approx(40.0 / 70).epsilon(0.01));
  compare(camera_of("\"camera_model\": \"OPENCV_FISHEYE\", \"k1\": 0.02, \"k4\": 0.003, \"p1\": "
                    "0.001, \"p2\": -0.002"),
          {70, 70, 80.5, 59.5, 0.02, 0, 0.001, -0.002, 0, 0.003, 0, 0}, thin_prism);
  const auto polynomial = [](const Numbers& q, const glm::dvec3& d) {
    const double x = d.x / d.z, y = d.y / d.z, s = x * x + y * y;
    const double radial = 1 + s * (q[4] + s * (q[5] + s * (q[6] + s * q[7])));
    const glm::dvec2 more = brown(x, y, q[8], q[9]);
    return pixel(q, x * radial + more.x, y * radial + more.y);
  };
  const Numbers q{70, 70, 80.5, 59.5, 0.1, -0.05, 0.02, 0.01, 0.001, 0.002};
  compare(camera_of("\"camera_model\": \"OPENCV\", \"k1\": 0.1, \"k2\": -0.05, \"k3\": 0.02, "
                    "\"k4\": 0.01, \"p1\": 0.001, \"p2\": 0.002"),
          q, polynomial);
  compare(camera_of("\"distortion_params\": [0.1, -0.05, 0.02, 0.01, 0.001, 0.002]"), q,
          polynomial);
  const Camera plain =
      camera_of("\"camera_model\": \"OPENCV_FISHEYE\", \"k1\": 0.02, \"fisheye_crop_radius\": 400");
  CHECK(plain.model == CameraModel::kFisheye);
  const Camera cut =
      camera_of("\"camera_model\": \"OPENCV_FISHEYE\", \"k1\": 0.02, \"fisheye_crop_radius\": 50");
  REQUIRE(cut.lens);
  CHECK(!project(cut, towards(0.75, 1)));
  CHECK(project(cut, towards(0.68, 1)));
  CHECK(contains(data_error([&] { camera_of("\"camera_model\": \"FISHEYE624\""); }),
                 "distortion_params"));
  CHECK(contains(data_error([&] { camera_of("\"distortion_params\": [1, 2]"); }), "has 2 numbers"));
  // Cameras to render with have the lens of the picture that would be compared.
  camera_of(aria_keys);
  const std::vector<Camera> cameras = read_cameras(scratch / "transforms.json");
  CHECK(cameras.front().model == CameraModel::kFisheye);
}

TEST_CASE("a camera of photos that has lost its lens sees nothing") {
  Camera camera;
  camera.width = camera.height = 8;
  camera.fx = camera.fy = 8;
  camera.model = CameraModel::kPhotoLens;
  CHECK(!project(camera, {0, 0, 1}));
  CHECK(!camera_ray(camera, 4, 4).valid);
  CHECK(rendered_camera(camera).model == CameraModel::kPhotoLens);
}

TEST_CASE("COLMAP's panoramas") {
  const Scratch scratch;
  ColmapFixture fixture;
  fixture.cameras = {{3, 17, "EQUIRECTANGULAR", 64, 32, {64, 32}}};
  fixture.images = {{1, {1, 0, 0, 0, 0, 0, 0}, 3, "a.png", 0}};
  fixture.points = {{{0, 0, 1}, {0, 0, 0}}};
  fixture.write_binary(scratch / "sparse/0");
  write_image(scratch / "images/a.png", Image(64, 32, 3, 0.5f));
  const Camera camera = load_dataset(scratch.path()).views.front().camera;
  CHECK(camera.model == CameraModel::kEquirectangular);
  CHECK(glm::distance(*project(camera, {1, 0, 0}), {48, 16}) < 1e-12);
  CHECK(glm::distance(*project(camera, {0, -1, 1}), {32, 8}) < 1e-12);
}
