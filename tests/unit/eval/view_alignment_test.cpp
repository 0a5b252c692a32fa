// SPDX-License-Identifier: Apache-2.0
#include "eval/view_alignment.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>

#include "eval/metrics.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/error.hpp"
#include "raysplats/evaluation.hpp"
#include "raysplats/io.hpp"
#include "scene/camera/camera_model.hpp"
#include "unit/temporary_directory.hpp"

namespace raysplats {
namespace {

constexpr int kWidth = 64, kHeight = 48;
constexpr double kSharp = 100;  // slope of the edges of tiles

// What a camera sees of a wavy pattern on a bowl of radius 4 around the origin: nearer in the
// middle of the picture than at its borders, so that shifts and turns do different things.
Image bowl(const Camera& camera) {
  Image out(camera.width, camera.height, 3);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const CameraRay ray = camera_ray(camera, x + 0.5, y + 0.5);
      const double along = glm::dot(ray.origin, ray.direction);
      const double behind = along * along - glm::dot(ray.origin, ray.origin) + 16.0;
      const glm::dvec3 p = ray.origin + (std::sqrt(behind) - along) * ray.direction;
      for (int c = 0; c < 3; ++c) {
        out.at(x, y, c) = static_cast<float>(
            0.5 + 0.2 * std::sin(3.0 * p.x + c) * std::cos(2.0 * p.y) + 0.2 * std::sin(2.5 * p.z));
      }
    }
  }
  return out;
}

// The same bowl of tiles with sharp edges.
Image tiled_bowl(const Camera& camera) {
  Image out = bowl(camera);
  for (float& value : out.data)
    value = static_cast<float>(0.5 + 0.4 * std::tanh(kSharp * (static_cast<double>(value) - 0.5)));
  return out;
}

Camera place(CameraModel model = CameraModel::kPinhole) {
  Camera camera = look_at({1.0, -0.5, -2.0}, {0.5, 0.5, 1.0}, {0, -1, 0}, kWidth, kHeight, 60);
  camera.model = model;
  return camera;
}

Image all_count() {
  Image out(kWidth, kHeight, 1);
  std::ranges::fill(out.data, 1.0f);
  return out;
}

double angle_between(const Camera& a, const Camera& b) {
  const glm::dmat3 turn = a.rotation * glm::transpose(b.rotation);
  return std::acos(std::clamp(0.5 * (turn[0][0] + turn[1][1] + turn[2][2] - 1.0), -1.0, 1.0));
}

// Two views whose cameras are not quite where their photos, `gain` times as bright, were taken.
Dataset misplaced_views(const TemporaryDirectory& folder, float gain) {
  Dataset dataset;
  dataset.root = folder.path();
  for (int i = 0; i < 2; ++i) {
    const Camera truth = moved(place(), {0, 0.1 * i, 0}, {0.1 * i, 0, 0});
    View view;
    view.camera = moved(truth, {0.01, -0.01, 0.005}, {0.02, 0.01, 0.0});
    view.camera.name = "view_" + std::to_string(i) + ".png";
    view.source_camera = view.camera;
    view.image_path = folder / view.camera.name;
    view.test = true;
    Image photo(kWidth, kHeight, 4);
    const Image seen = bowl(truth);
    for (std::size_t p = 0; p < photo.pixels(); ++p) {
      for (std::size_t c = 0; c < 3; ++c) photo.data[4 * p + c] = gain * seen.data[3 * p + c];
      photo.data[4 * p + 3] = 1.0f;
    }
    write_image(view.image_path, photo);
    dataset.views.push_back(view);
  }
  return dataset;
}

}  // namespace

TEST_CASE("a camera finds back to where its photo was taken") {
  for (const CameraModel model :
       {CameraModel::kPinhole, CameraModel::kFisheye, CameraModel::kEquirectangular}) {
    CAPTURE(static_cast<int>(model));
    const Camera truth = place(model);
    const Image photo = bowl(truth);
    const Camera start = moved(truth, {0.02, -0.015, 0.01}, {0.05, -0.03, 0.04});
    std::size_t pictures = 0;
    const auto render = [&](const Camera& camera) {
      ++pictures;
      return bowl(camera);
    };
    const auto found = align_view(render, start, photo, all_count());
    REQUIRE(found);
    CHECK(pictures <= 160);  // nothing but rounding ends it: no noise is left
    CHECK(angle_between(start, truth) > 0.02);
    CHECK(angle_between(found->camera, truth) < 5e-4);
    CHECK(glm::distance(found->camera.center(), truth.center()) < 2e-3);
    CHECK(found->render.data == bowl(found->camera).data);
    CHECK(psnr(found->render, photo) > psnr(bowl(start), photo) + 20.0);
  }
}

TEST_CASE("a camera that is a degree and 2 % off finds back before sharp edges") {
  const Camera truth = place();
  const double turn = 3.14159265358979 / 180.0 / std::sqrt(3.0), shift = 0.08 / std::sqrt(3.0);
  for (const double sign : {1.0, -1.0}) {
    CAPTURE(sign);
    const Camera start = moved(truth, {turn, turn, turn}, {sign * shift, -sign * shift, shift});
    const auto found = align_view(tiled_bowl, start, tiled_bowl(truth), all_count());
    REQUIRE(found);
    CHECK(angle_between(found->camera, truth) < 5e-4);
    CHECK(glm::distance(found->camera.center(), truth.center()) < 2e-3);
  }
}

TEST_CASE("what does not count does not move a camera, and nothing makes a view worse") {
  const Camera truth = place();
  Image photo = bowl(truth);
  Image weight = all_count();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 3; ++x) {
      weight.at(x, y, 0) = 0.0f;
      for (int c = 0; c < 3; ++c) photo.at(x, y, c) = x % 2 == 0 ? 1.0f : 0.0f;
    }
  }
  const Camera start = moved(truth, {0.01, 0.01, 0.0}, {0.02, 0.0, 0.0});
  const auto found = align_view(bowl, start, photo, weight);
  REQUIRE(found);
  CHECK(angle_between(found->camera, truth) < 1e-3);
  // At its place already, before an even picture, and where nothing counts.
  CHECK(angle_between(align_view(bowl, truth, bowl(truth), all_count())->camera, truth) == 0.0);
  const auto even = [](const Camera& camera) { return Image(camera.width, camera.height, 3); };
  CHECK(angle_between(align_view(even, truth, bowl(truth), all_count())->camera, truth) == 0.0);
  const Image none(kWidth, kHeight, 1);
  CHECK(angle_between(align_view(bowl, start, photo, none)->camera, start) == 0.0);
}

TEST_CASE("an alignment that is stopped yields nothing") {
  const Camera truth = place();
  const Image photo = bowl(truth);
  const Camera start = moved(truth, {0.02, 0.0, 0.0}, {0, 0, 0});
  for (std::size_t until : {0, 1, 2, 7, 12, 13}) {
    CAPTURE(until);
    std::size_t pictures = 0;
    const auto render = [&](const Camera& camera) {
      return pictures++ < until ? bowl(camera) : Image();
    };
    CHECK_FALSE(align_view(render, start, photo, all_count()));
    CHECK(pictures == until + 1);
  }
}

TEST_CASE("evaluator: views with wrong poses are judged where they fit") {
  const TemporaryDirectory folder;
  const Dataset dataset = misplaced_views(folder, 1.0f);
  EvaluationOptions options;
  const EvaluationReport plain = evaluate(bowl, dataset, Split::kTest, {}, {}, options);
  CHECK_FALSE(plain.mean.psnr_aligned);
  CHECK(plain.json().find("psnr_aligned") == std::string::npos);
  options.align = true;
  const EvaluationReport report = evaluate(bowl, dataset, Split::kTest, {}, {}, options);
  REQUIRE(report.images.size() == 2);
  double mean = 0;
  for (const EvaluationMetrics& image : report.images) {
    REQUIRE(image.psnr_aligned);
    CHECK(*image.psnr_aligned > 45.0);  // 8-bit photos
    CHECK(image.psnr < 32.0);
    mean += 0.5 * *image.psnr_aligned;
  }
  CHECK(report.mean.psnr == doctest::Approx(plain.mean.psnr));
  CHECK(*report.mean.psnr_aligned == doctest::Approx(mean));
  CHECK(report.json().find("psnr_aligned") != std::string::npos);
  CHECK(report.table().find("aligned") != std::string::npos);
  // Stopped in the second view: the first one is told.
  std::size_t pictures = 0;
  const auto stops = [&](const Camera& camera) {
    return camera.name == dataset.views[1].camera.name && ++pictures > 3 ? Image() : bowl(camera);
  };
  const EvaluationReport part = evaluate(stops, dataset, Split::kTest, {}, {}, options);
  REQUIRE(part.images.size() == 1);
  CHECK(part.mean.psnr_aligned == report.images[0].psnr_aligned);
  options.together = true;
  CHECK_THROWS_AS(evaluate(bowl, dataset, Split::kTest, {}, {}, options), UsageError);
}

TEST_CASE("evaluator: views with wrong poses and other exposures are judged without either") {
  const TemporaryDirectory folder;
  const Dataset dataset = misplaced_views(folder, 0.7f);
  EvaluationOptions options;
  options.align = true;
  const EvaluationReport plain = evaluate(bowl, dataset, Split::kTest, {}, {}, options);
  CHECK(*plain.mean.psnr_aligned < 20.0);
  CHECK(plain.mean.psnr_corrected < 40.0);
  options.align_colors = true;
  const EvaluationReport report = evaluate(bowl, dataset, Split::kTest, {}, {}, options);
  for (const EvaluationMetrics& image : report.images) CHECK(*image.psnr_aligned > 45.0);
  CHECK(report.mean.psnr == plain.mean.psnr);
  CHECK(report.mean.psnr_corrected == plain.mean.psnr_corrected);
}

}  // namespace raysplats
