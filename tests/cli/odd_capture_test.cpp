// SPDX-License-Identifier: Apache-2.0
// Captures that lack what training expects: each is said in one sentence, and only what cannot be
// trained on ends the run.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "program.hpp"
#include "raysplats/io.hpp"

namespace fs = std::filesystem;

namespace {

constexpr int kSize = 16;

/// Four photos for training and one that is held out.
void make_data(const std::string& path) {
  const Outcome outcome = raysplats_program({"generate", path, "--size", std::to_string(kSize),
                                             "--train-views", "4", "--test-views", "1", "-q"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
}

nlohmann::json training_file(const std::string& data) {
  return nlohmann::json::parse(read_file(data + "/transforms_train.json"));
}

/// Keeps the first photos for training alone; without `test` none is held out by the files.
void keep_photos(const std::string& data, std::size_t count, bool test) {
  nlohmann::json json = training_file(data);
  nlohmann::json& frames = json["frames"];
  frames.erase(frames.begin() + static_cast<std::ptrdiff_t>(count), frames.end());
  write_file(data + "/transforms_train.json", json.dump());
  if (!test) fs::remove(data + "/transforms_test.json");
}

/// Gives the second photo a mask of one value.
void add_mask(const std::string& data, int width, int height, float value) {
  raysplats::Image mask(width, height, 3);
  for (float& number : mask.data) number = value;
  raysplats::write_image(data + "/mask.png", mask);
  nlohmann::json json = training_file(data);
  json["frames"][1]["mask_path"] = "mask.png";
  write_file(data + "/transforms_train.json", json.dump());
}

/// Changes every pixel of all photos.
template <class Paint>
void paint_photos(const std::string& data, const Paint& paint) {
  for (const char* const split : {"train", "test"}) {
    for (const fs::directory_entry& file : fs::directory_iterator(data + "/" + split)) {
      if (file.path().extension() != ".png") continue;
      raysplats::Image photo = raysplats::read_image(file.path());
      REQUIRE(photo.channels == 4);
      for (int y = 0; y < photo.height; ++y) {
        for (int x = 0; x < photo.width; ++x) paint(photo, x, y);
      }
      raysplats::write_image(file.path(), photo);
    }
  }
}

/// The photo as a lens out of focus had shown it: a Gaussian of `sigma` pixels over it.
raysplats::Image out_of_focus(const raysplats::Image& photo, double sigma) {
  const int reach = static_cast<int>(std::ceil(3 * sigma));
  const auto along = [&](const raysplats::Image& from, int step_x, int step_y) {
    raysplats::Image out(from.width, from.height, from.channels);
    for (int y = 0; y < from.height; ++y) {
      for (int x = 0; x < from.width; ++x) {
        for (int c = 0; c < from.channels; ++c) {
          double sum = 0, weights = 0;
          for (int k = -reach; k <= reach; ++k) {
            const int at_x = std::clamp(x + k * step_x, 0, from.width - 1);
            const int at_y = std::clamp(y + k * step_y, 0, from.height - 1);
            const double weight = std::exp(-0.5 * k * k / (sigma * sigma));
            sum += weight * static_cast<double>(from.at(at_x, at_y, c));
            weights += weight;
          }
          out.at(x, y, c) = static_cast<float>(sum / weights);
        }
      }
    }
    return out;
  };
  return along(along(photo, 1, 0), 0, 1);
}

Outcome train(const std::string& data, const std::string& run, const Words& more = {}) {
  Words words{"train", data,          "-o", run, "-n", "4", "--resolution-schedule",
              "[]",    "--sh-degree", "0"};
  words.insert(words.end(), more.begin(), more.end());
  return raysplats_program(words);
}

/// The run ends well and says `remark` once.
void check_trains(const Outcome& outcome, const std::string& remark) {
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  const std::size_t at = outcome.err.find(remark);
  REQUIRE(at != std::string::npos);
  CHECK(outcome.err.find(remark, at + 1) == std::string::npos);
}

}  // namespace

TEST_CASE("the report names the training photo that is out of focus, and no sharp one") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  REQUIRE(raysplats_program(
              {"generate", data, "--size", "64", "--train-views", "9", "--test-views", "1", "-q"})
              .code == 0);
  const auto report = [&](const std::string& run) {
    const Outcome outcome = raysplats_program({"train", data, "-o", run, "-n", "9"});
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    return read_file(run + "/report.html");
  };
  const std::string warning = "photos less sharp than the others";
  CHECK(!contains(report(folder / "sharp"), warning));
  const std::string photo = data + "/train/r_4.png";
  raysplats::write_image(photo, out_of_focus(raysplats::read_image(photo), 3.0));
  const std::string page = report(folder / "blurred");
  const std::size_t at = page.find(warning);
  REQUIRE(at != std::string::npos);
  const std::string sentence = page.substr(at, page.find('<', at) - at);
  INFO(sentence);
  CHECK(sentence.ends_with(": train/r_4.png."));
}

TEST_CASE(
    "the report names the training photo with a wrong pose, exposure or content, and no other") {
  const TemporaryFolder folder;
  const auto named = [&](const std::string& run, const auto& spoil) {
    const std::string data = folder / (run + "_data");
    REQUIRE(raysplats_program({"generate", data, "--size", "64", "--train-views", "16",
                               "--test-views", "1", "-q"})
                .code == 0);
    spoil(data);
    const Outcome outcome = raysplats_program({"train", data, "-o", folder / run, "-n", "400"});
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    const std::string page = read_file(folder / (run + "/report.html"));
    const std::string warning = "or something in them has moved: ";
    const std::size_t at = page.find(warning);
    if (at == std::string::npos) return std::string();
    return page.substr(at + warning.size(), page.find('<', at) - at - warning.size());
  };
  CHECK(named("clean", [](const std::string&) {}).empty());
  CHECK(named("pose", [](const std::string& data) {
          nlohmann::json json = training_file(data);
          json["frames"][5]["transform_matrix"] = json["frames"][12]["transform_matrix"];
          write_file(data + "/transforms_train.json", json.dump());
        }) == "train/r_5.png.");
  CHECK(named("exposure", [](const std::string& data) {
          raysplats::Image photo = raysplats::read_image(data + "/train/r_7.png");
          for (std::size_t i = 0; i < photo.data.size(); ++i) photo.data[i] *= i % 4 < 3 ? 0.4f : 1;
          raysplats::write_image(data + "/train/r_7.png", photo);
        }) == "train/r_7.png.");
  CHECK(named("moved", [](const std::string& data) {
          raysplats::Image photo = raysplats::read_image(data + "/train/r_2.png");
          for (int y = 20; y < 44; ++y) {
            for (int x = 20; x < 44; ++x) {
              photo.at(x, y, 0) = photo.at(x, y, 1) = photo.at(x, y, 3) = 1;
              photo.at(x, y, 2) = 0;
            }
          }
          raysplats::write_image(data + "/train/r_2.png", photo);
        }) == "train/r_2.png.");
}

TEST_CASE(
    "photos that are transparent everywhere are refused before training, faint ones are not") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  make_data(data);
  paint_photos(data,
               [](raysplats::Image& photo, int x, int y) { photo.at(x, y, 3) = 100.0f / 255.0f; });
  check_trains(train(data, folder / "faint"), "iterations, up to");
  paint_photos(data, [](raysplats::Image& photo, int x, int y) { photo.at(x, y, 3) = 0; });
  for (const char* const init : {"auto", "random"}) {
    CAPTURE(init);
    check_refusal(train(data, folder / init, {"-q", "--init", init}), 2,
                  "masks, areas or transparent pixels leave 0 % of the photos");
    CHECK(!fs::exists(folder / init));
  }
}

TEST_CASE("photos of one colour are learned from the beginning, whatever the cap") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  make_data(data);
  paint_photos(data, [](raysplats::Image& photo, int x, int y) {
    photo.at(x, y, 0) = 0.2f;
    photo.at(x, y, 1) = 0.6f;
    photo.at(x, y, 2) = 0.4f;
    photo.at(x, y, 3) = 1;
  });
  for (const char* const most : {"10", "500"}) {
    CAPTURE(most);
    const Outcome outcome =
        raysplats_program({"train", data, "-o", folder / most, "-n", "40", "--log-every", "1",
                           "--init", "photos", "--max-gaussians", most});
    INFO(outcome.err);
    CHECK(outcome.code == 0);
    CHECK(!contains(outcome.err, "learned nothing"));
  }
}

TEST_CASE("masks that cannot belong to their photo are refused with their name") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  make_data(data);
  add_mask(data, kSize, kSize / 2, 1.0f);
  check_refusal(train(data, folder / "shape", {"-q"}), 3, "mask.png has 16 x 8 pixels");
  // The same shape in another size is the photo's all the same.
  add_mask(data, 2 * kSize, 2 * kSize, 1.0f);
  check_trains(train(data, folder / "size"), "1 of 5 photos have a mask");
}

TEST_CASE("photos whose masks are black everywhere are left out, and are not all that there is") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  make_data(data);
  add_mask(data, kSize, kSize, 0.0f);
  const Outcome one = train(data, folder / "one");
  check_trains(one, "warning: 1 of 5 photos are left out");
  CHECK(contains(one.err, "mask.png"));
  nlohmann::json json = training_file(data);
  for (nlohmann::json& frame : json["frames"]) frame["mask_path"] = "mask.png";
  write_file(data + "/transforms_train.json", json.dump());
  check_refusal(train(data, folder / "all", {"-q"}), 3,
                "masks of all 4 training photos of " + data);
}

TEST_CASE("one or two photos are trained on, with a warning of what they leave open") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  make_data(data);
  keep_photos(data, 2, true);
  check_trains(train(data, folder / "two"), "warning: 2 training views of " + data);
  keep_photos(data, 1, false);
  const Outcome one = train(data, folder / "one");
  check_trains(one, "warning: 1 training view of " + data);
  check_trains(one, "no view is held out, so nothing is measured");
  CHECK_FALSE(contains(one.err + one.out, "--test-every"));
  keep_photos(data, 0, false);
  check_refusal(train(data, folder / "none", {"-q"}), 3, "has no views");
}

TEST_CASE("a run without test views says that nothing is measured") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  make_data(data);
  keep_photos(data, 4, false);
  const Outcome outcome = train(data, folder / "run", {"--test-every", "0"});
  check_trains(outcome, "so nothing is measured: --test-every 8 holds some out");
  CHECK_FALSE(contains(outcome.out, "PSNR"));
  check_refusal(train(data, folder / "all", {"-q", "--test-every", "1"}), 2,
                "--test-every 1 holds all of them out");
}

TEST_CASE("depth maps are taken as far as they know something, and refused with their name") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  make_data(data);
  const Words weight{"--depth-weight", "0.5", "--depth-unit", "1"};
  Words quiet = weight;
  quiet.push_back("-q");
  check_refusal(train(data, folder / "without", quiet), 2, "neither depth maps nor sparse points");

  nlohmann::json json = training_file(data);
  json["frames"][1]["depth_file_path"] = "depth.npy";
  write_file(data + "/transforms_train.json", json.dump());
  check_refusal(train(data, folder / "missing", quiet), 3, "the depth map 'depth.npy' of frame 1");
  const auto write_map = [&](int width, int height, float value, float first) {
    std::vector<float> numbers(static_cast<std::size_t>(width * height), value);
    numbers[0] = first;
    write_npy(data + "/depth.npy", "False", fmt::format("({}, {})", height, width), numbers);
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  write_map(kSize, kSize, 4.0f, nan);
  check_trains(train(data, folder / "nan", weight), "1 of 256 numbers of the depth map");
  write_map(kSize, kSize, nan, nan);
  check_refusal(train(data, folder / "nothing", quiet), 3,
                "No depth map has a number above 0, " + data + "/depth.npy");
  write_map(kSize, kSize / 2, 4.0f, 4.0f);
  check_refusal(train(data, folder / "shape", quiet), 3, "depth.npy has 16 x 8 pixels");
  // Maps are not read by runs that do not ask for them.
  check_trains(train(data, folder / "off"), "iterations, up to");
}

TEST_CASE("a cap below the start takes a part of it, and never what was asked for by number") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  make_data(data);
  check_refusal(train(data, folder / "count", {"-q", "--init-count", "50", "--max-gaussians", "8"}),
                2, "'init-count' = 50 Gaussians is above 'max-gaussians' = 8");
  check_refusal(train(data, folder / "typo", {"-q", "--init", "point"}), 3,
                "The start 'point' is neither a file that exists nor one of auto, colmap, photos");
  write_file(folder / "model.ply", ply_file(20));
  const Words from_model{"--init", folder / "model.ply", "--max-gaussians", "8"};
  const Outcome outcome = train(data, folder / "model", from_model);
  check_trains(outcome, "has 20 Gaussians, but this run may have 8");
  CHECK(contains(outcome.out, ": 8 Gaussians in "));
}
