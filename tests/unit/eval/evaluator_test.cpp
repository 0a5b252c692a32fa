// SPDX-License-Identifier: Apache-2.0
#include "raysplats/evaluation.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "build_paths.hpp"
#include "comm/thread_ranks.hpp"
#include "eval/metrics.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "unit/log_capture.hpp"
#include "unit/temporary_directory.hpp"

namespace raysplats {
namespace {

constexpr int kWidth = 24;
constexpr int kHeight = 18;

// A folder with two test photos and one training photo; the right half of each is transparent.
class Scene {
 public:
  Scene() {
    dataset.root = folder_.path();
    for (int i = 0; i < 3; ++i) {
      Image photo(kWidth, kHeight, 4);
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          for (int c = 0; c < 3; ++c)
            photo.at(x, y, c) =
                static_cast<float>((x * 7 + y * 3 + c * 11 + i * 40) % 256) / 255.0f;
          photo.at(x, y, 3) = x < kWidth / 2 ? 1.0f : 0.0f;
        }
      }
      View view;
      view.camera.name = "photos/view_" + std::to_string(i) + ".png";
      view.camera.width = kWidth;
      view.camera.height = kHeight;
      view.camera.fx = view.camera.fy = 20;
      view.camera.cx = kWidth / 2.0;
      view.camera.cy = kHeight / 2.0;
      view.source_camera = view.camera;
      view.image_path = folder_ / ("view_" + std::to_string(i) + ".png");
      view.test = i < 2;
      write_image(view.image_path, photo);
      dataset.views.push_back(view);
    }
  }
  std::filesystem::path path(const char* name) const { return folder_ / name; }
  const View& view(const std::string& name) const {
    return *std::find_if(dataset.views.begin(), dataset.views.end(),
                         [&](const View& v) { return v.camera.name == name; });
  }

  Dataset dataset;

 private:
  TemporaryDirectory folder_;
};

constexpr std::array<float, 3> kBackground{1.0f, 0.5f, 0.0f};

}  // namespace

TEST_CASE("evaluator: a perfect render over the background, written with its pictures") {
  Scene scene;
  scene.dataset.alpha_is_background = true;
  const auto render = [&](const Camera& camera) {
    Image image = composite(load_view_image(scene.view(camera.name)), kBackground.data());
    for (float& value : image.data) value += 0.1f;  // beyond 1 where the photo is bright: clamped
    return image;
  };
  const std::filesystem::path output = scene.path("report");
  const EvaluationReport report =
      evaluate(render, scene.dataset, Split::kTest, kBackground, output);
  REQUIRE(report.images.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    const Image photo = composite(load_view_image(scene.dataset.views[i]), kBackground.data());
    Image expected = photo;
    for (float& value : expected.data) value = std::min(value + 0.1f, 1.0f);
    CHECK(report.images[i].psnr == doctest::Approx(psnr(expected, photo)).epsilon(1e-6));
    CHECK(report.images[i].ssim == doctest::Approx(ssim(expected, photo)).epsilon(1e-6));
    CHECK(report.images[i].name == scene.dataset.views[i].camera.name);
  }
  CHECK(report.mean.psnr == doctest::Approx((report.images[0].psnr + report.images[1].psnr) / 2));
  CHECK_FALSE(report.mean.lpips.has_value());

  std::ifstream stream(output / "metrics.json");
  const nlohmann::json json = nlohmann::json::parse(stream);
  CHECK(json.at("psnr").get<double>() == doctest::Approx(report.mean.psnr));
  CHECK(json.at("ssim").get<double>() == doctest::Approx(report.mean.ssim));
  CHECK_FALSE(json.contains("lpips"));
  REQUIRE(json.at("images").size() == 2);
  CHECK(json.at("images")[1].at("name") == "photos/view_1.png");
  CHECK(json.at("images")[1].at("psnr").get<double>() == doctest::Approx(report.images[1].psnr));
  const Image picture = read_image(output / "view_0.png");
  CHECK(picture.width == 3 * kWidth);
  CHECK(picture.height == kHeight);
  CHECK(std::filesystem::exists(output / "view_1.png"));
  CHECK(report.table().find("mean") != std::string::npos);
}

TEST_CASE("evaluator: masked pixels neither help nor hurt") {
  Scene scene;
  // The other half, where both are equal, does not count as perfect.
  double expected_ssim = 0;
  {
    const Image rgba = load_view_image(scene.dataset.views[0]);
    Image photo(kWidth, kHeight, 3), off(kWidth, kHeight, 3), half(kWidth, kHeight, 1);
    for (std::size_t p = 0; p < photo.pixels(); ++p) {
      for (std::size_t c = 0; c < 3; ++c) {
        const float value = photo.data[3 * p + c] = rgba.data[4 * p + c];
        const bool counts = rgba.data[4 * p + 3] > 0;
        off.data[3 * p + c] = value + (counts ? value < 0.5f ? 0.2f : -0.2f : 0.0f);
        half.data[p] = counts ? 1.0f : 0.0f;
      }
    }
    expected_ssim = weighted_ssim(off, photo, half);
    CHECK(expected_ssim < ssim(off, photo) - 0.05);
  }
  // Off by 0.2 where the photo is valid, by anything elsewhere.
  for (const float elsewhere : {0.0f, 0.9f}) {
    const auto render = [&](const Camera& camera) {
      const Image rgba = load_view_image(scene.view(camera.name));
      Image image(kWidth, kHeight, 4, elsewhere);
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth / 2; ++x) {
          for (int c = 0; c < 3; ++c)
            image.at(x, y, c) = rgba.at(x, y, c) + (rgba.at(x, y, c) < 0.5f ? 0.2f : -0.2f);
        }
      }
      return image;
    };
    EvaluationOptions options;
    options.max_views = 1;
    const EvaluationReport report =
        evaluate(render, scene.dataset, Split::kTest, kBackground, {}, options);
    REQUIRE(report.images.size() == 1);
    CHECK(report.mean.psnr == doctest::Approx(-20 * std::log10(0.2)).epsilon(1e-4));
    CHECK(report.mean.ssim == doctest::Approx(expected_ssim).epsilon(1e-6));
    // Beside it what all pixels give, those under the mask included.
    REQUIRE(report.mean.psnr_all.has_value());
    const View& view = scene.dataset.views[0];
    const Image rgba = load_view_image(view);
    Image rgb(kWidth, kHeight, 3), shown(kWidth, kHeight, 3);
    const Image traced = render(view.camera);
    for (std::size_t p = 0; p < rgb.pixels(); ++p) {
      for (std::size_t c = 0; c < 3; ++c) {
        rgb.data[3 * p + c] = rgba.data[4 * p + c];
        shown.data[3 * p + c] = std::clamp(traced.data[4 * p + c], 0.0f, 1.0f);
      }
    }
    CHECK(*report.mean.psnr_all == doctest::Approx(psnr(shown, rgb)).epsilon(1e-6));
    CHECK(nlohmann::json::parse(report.json()).contains("psnr_all"));
  }
}

TEST_CASE("evaluator: how bright a mask is where it counts does not matter") {
  Scene scene;
  View& view = scene.dataset.views[0];
  const Image photo = load_view_image(view);
  view.mask_path = scene.path("mask.png");
  const auto render = [&](const Camera& camera) {
    Image image(camera.width, camera.height, 3);
    for (std::size_t p = 0; p < image.pixels(); ++p) {
      for (std::size_t c = 0; c < 3; ++c)
        image.data[3 * p + c] = 0.8f * photo.data[4 * p + c] + 0.02f * static_cast<float>(p % 5);
    }
    return image;
  };
  EvaluationOptions options;
  options.max_views = 1;
  std::vector<EvaluationMetrics> means;
  for (const int level : {255, 128, 2}) {
    Image mask(kWidth, kHeight, 1, 0.0f);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 3; x < 10; ++x) mask.at(x, y, 0) = static_cast<float>(level) / 255.0f;
    }
    write_image(view.mask_path, mask);
    means.push_back(evaluate(render, scene.dataset, Split::kTest, kBackground, {}, options).mean);
    CHECK(means.back().psnr == doctest::Approx(means[0].psnr).epsilon(1e-5));
    CHECK(means.back().ssim == doctest::Approx(means[0].ssim).epsilon(1e-5));
  }
  CHECK(means[0].ssim < 0.995);
  // Black as lossy files have it, 1 of 255, hides what is beneath it all the same.
  Image lossy(kWidth, kHeight, 1, 1.0f / 255.0f);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 3; x < 10; ++x) lossy.at(x, y, 0) = 1.0f;
  }
  write_image(view.mask_path, lossy);
  const EvaluationMetrics mean =
      evaluate(render, scene.dataset, Split::kTest, kBackground, {}, options).mean;
  CHECK(mean.ssim == doctest::Approx(means[0].ssim).epsilon(2e-3));
}

TEST_CASE("evaluator: equal pictures have a PSNR, and views without a pixel are left out") {
  Scene scene;
  const auto photo = [&](const Camera& camera) { return load_view_image(scene.view(camera.name)); };
  const EvaluationReport same = evaluate(photo, scene.dataset, Split::kTest, kBackground);
  CHECK(same.mean.psnr <= kMostPsnr);
  CHECK(same.mean.psnr > kMostPsnr - 5);  // half of the pixels count
  CHECK(same.json().find("null") == std::string::npos);

  write_image(scene.dataset.views[0].image_path, Image(kWidth, kHeight, 4, 0.0f));
  EvaluationOptions options;
  std::size_t heard = 0;
  options.done = [&](std::size_t count) { return heard = count, true; };
  const EvaluationReport rest =
      evaluate(photo, scene.dataset, Split::kTest, kBackground, {}, options);
  REQUIRE(rest.images.size() == 1);
  CHECK(rest.images[0].name == scene.dataset.views[1].camera.name);
  CHECK(heard == 2);
  write_image(scene.dataset.views[1].image_path, Image(kWidth, kHeight, 4, 0.0f));
  CHECK_THROWS_AS(evaluate(photo, scene.dataset, Split::kTest, kBackground), DataError);
}

TEST_CASE("evaluator: photos whose masks ignore all of them are told once and count nowhere") {
  Scene scene;
  const std::filesystem::path mask = scene.path("black.png");
  write_image(mask, Image(kWidth, kHeight, 1, 0.0f));
  const auto photo = [&](const Camera& camera) { return load_view_image(scene.view(camera.name)); };
  for (const bool apart : {false, true}) {
    CAPTURE(apart);
    scene.dataset.alpha_is_background = apart;
    for (const std::size_t i : {std::size_t{0}, std::size_t{2}}) {
      scene.dataset.views[i].mask_path = mask;
      scene.dataset.views[i].mask_apart = apart;
    }
    const LogCapture log;
    const EvaluationReport report = evaluate(photo, scene.dataset, Split::kAll, {0, 0, 0});
    REQUIRE(report.images.size() == 1);
    CHECK(report.images[0].name == scene.dataset.views[1].camera.name);
    CHECK(std::isfinite(report.mean.psnr));
    CHECK(std::isfinite(report.mean.ssim));
    CHECK(log.lines() == 1);
    CHECK(log.contains("2 of 3 views cannot be compared"));
  }
}

TEST_CASE("evaluator: few pictures show worst, median and best, then the first, by name") {
  Scene scene;
  const View view = scene.dataset.views[0];
  scene.dataset.views.clear();
  // Names whose stems are equal, as cameras side by side give them.
  const std::array<float, 6> errors{0.2f, 0.1f, 0.5f, 0.3f, 0.05f, 0.25f};
  for (std::size_t i = 0; i < errors.size(); ++i) {
    scene.dataset.views.push_back(view);
    scene.dataset.views.back().camera.name = "side_" + std::to_string(i) + "/0001.png";
    scene.dataset.views.back().test = true;
  }
  std::size_t traced = 0;
  const auto render = [&](const Camera& camera) {
    ++traced;
    Image image = load_view_image(view);
    const float error = errors.at(static_cast<std::size_t>(camera.name[5] - '0'));
    for (float& value : image.data) value += value < 0.5f ? error : -error;
    return image;
  };
  const auto pictured = [&](std::size_t most) {
    const auto output = scene.path("telling") / std::to_string(most);
    EvaluationOptions options;
    options.max_pictures = most;
    const EvaluationReport report =
        evaluate(render, scene.dataset, Split::kTest, kBackground, output, options);
    std::ifstream stream(output / "metrics.json");
    const nlohmann::json images = nlohmann::json::parse(stream).at("images");
    std::string numbers;
    for (std::size_t i = 0; i < errors.size(); ++i) {
      CHECK(images.at(i).value("picture", "") == report.images.at(i).picture);
      if (report.images[i].picture.empty()) continue;
      CHECK(std::filesystem::exists(output / report.images[i].picture));
      numbers += std::to_string(i);
    }
    const auto files = std::distance(std::filesystem::directory_iterator(output),
                                     std::filesystem::directory_iterator());
    CHECK(files == static_cast<std::ptrdiff_t>(numbers.size() + 1));
    return numbers;
  };
  CHECK(pictured(0).empty());
  CHECK(pictured(1) == "2");
  CHECK(pictured(3) == "024");
  traced = 0;
  CHECK(pictured(4) == "0124");
  CHECK(traced == 10);
  CHECK(pictured(6) == "012345");
  CHECK(traced == 16);  // all are written as they are measured

  // A picture that was not written, since tracing it again was stopped, is not named.
  std::size_t calls = 0;
  const auto interrupted = [&](const Camera& camera) {
    return ++calls > errors.size() ? Image() : render(camera);
  };
  EvaluationOptions options;
  options.max_pictures = 2;
  const EvaluationReport report = evaluate(interrupted, scene.dataset, Split::kTest, kBackground,
                                           scene.path("stopped"), options);
  REQUIRE(report.images.size() == errors.size());
  for (const EvaluationMetrics& image : report.images) CHECK(image.picture.empty());
}

TEST_CASE("evaluator: ranks that render every view together stop together") {
  Scene scene;
  for (View& view : scene.dataset.views) view.test = true;
  // At the second of three views, after which the first is rendered again for its picture, and at
  // the first of two pictures.
  for (const auto& [stop_at, until] : std::array<std::array<int, 2>, 2>{{{2, 3}, {4, 4}}}) {
    std::array<int, 2> calls{};
    const int at = stop_at;
    run_thread_ranks(2, [&](Communicator& ranks) {
      int& own = calls[static_cast<std::size_t>(ranks.rank())];
      const auto render = [&](const Camera& camera) {
        if (++own == at) return Image();
        return Image(camera.width, camera.height, 4, 0.5f);
      };
      EvaluationOptions options;
      options.max_pictures = 2;
      options.ranks = &ranks;
      options.together = true;
      evaluate(render, scene.dataset, Split::kTest, {0, 0, 0}, scene.path("stopped"), options);
    });
    CHECK(calls[0] == until);
    CHECK(calls[1] == until);
  }
}

TEST_CASE("evaluator: limits, early stop, LPIPS and refusals") {
  Scene scene;
  const auto render = [](const Camera& camera) {
    return Image(camera.width, camera.height, 3, 0.5f);
  };
  CHECK_THROWS_AS(evaluate(render, scene.dataset, Split::kAll, {0, NAN, 0}, {}), UsageError);
  EvaluationOptions options;
  options.max_pictures = 1;
  std::size_t heard = 0;
  options.done = [&](std::size_t finished) {
    heard = finished;
    return finished < 2;
  };
  EvaluationReport report =
      evaluate(render, scene.dataset, Split::kAll, kBackground, scene.path("few"), options);
  CHECK(heard == 2);
  CHECK(report.images.size() == 2);
  CHECK(std::filesystem::exists(scene.path("few") / "metrics.json"));
  CHECK(std::distance(std::filesystem::directory_iterator(scene.path("few")),
                      std::filesystem::directory_iterator()) == 2);

  if (Lpips::available()) {
    Lpips lpips(std::filesystem::path(test::source_dir()) / "tests/data/tiny_lpips.onnx");
    options = {};
    options.lpips = &lpips;
    report = evaluate(render, scene.dataset, Split::kTrain, kBackground, {}, options);
    REQUIRE(report.mean.lpips.has_value());
    CHECK(*report.mean.lpips > 0);
    CHECK(nlohmann::json::parse(report.json()).at("images")[0].contains("lpips"));
  }

  const auto wrong_size = [](const Camera&) { return Image(2, 2, 3); };
  CHECK_THROWS_AS(evaluate(wrong_size, scene.dataset, Split::kTest, kBackground), UsageError);
  const auto too_short = [](const Camera& camera) {
    Image image(camera.width, camera.height, 3);
    image.data.pop_back();
    return image;
  };
  CHECK_THROWS_AS(evaluate(too_short, scene.dataset, Split::kTest, kBackground), UsageError);
  EvaluationOptions other_photo;
  other_photo.photo = [&](std::size_t i) {
    auto picture = std::make_shared<ViewPicture>(load_view_picture(scene.dataset.views[i]));
    picture->rgba.data.pop_back();
    return picture;
  };
  CHECK_THROWS_AS(evaluate(render, scene.dataset, Split::kTest, kBackground, {}, other_photo),
                  UsageError);
  for (View& view : scene.dataset.views) view.test = false;
  CHECK_THROWS_AS(evaluate(render, scene.dataset, Split::kTest, kBackground), UsageError);
}

}  // namespace raysplats
