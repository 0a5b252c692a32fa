// SPDX-License-Identifier: Apache-2.0
// Scene files whose cameras are those of a data set: what they show is what the model alone shows.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "program.hpp"
#include "raysplats/io.hpp"

namespace fs = std::filesystem;

namespace {

using Names = std::set<std::string>;

constexpr double kOrigin[3] = {1000, 2000, 3000};

/// A data set of four photos to train on and three to test, as a survey has it: far from 0. A run
/// that counts from near it, at half size, of three balls in sight.
class Survey {
 public:
  Survey() {
    call({"generate", folder_ / "data", "--size", "32", "--train-views", "4", "--test-views", "3"});
    for (const std::string& file :
         {path("data/transforms_train.json"), path("data/transforms_test.json")}) {
      nlohmann::json json = nlohmann::json::parse(read_file(file));
      for (nlohmann::json& frame : json.at("frames")) {
        for (std::size_t k = 0; k < 3; ++k) {
          nlohmann::json& at = frame.at("transform_matrix").at(k).at(3);
          at = at.get<double>() + kOrigin[k];
        }
      }
      write_file(file, json.dump());
    }
    std::string model = ply_file(3);
    model.insert(model.find("element"), "comment raysplats origin 1000,2000,3000\n");
    write_file(path("run/point_cloud/iteration_1/point_cloud.ply"), model);
    write_file(path("run/config.toml"),
               "downscale = 2\norigin = \"1000,2000,3000\"\nbackground = \"0.2,0.4,0.6\"\n");
  }

  std::string path(const std::string& name) const { return folder_ / name; }
  void call(std::vector<std::string> words) const {
    words.emplace_back("-q");
    const Outcome outcome = raysplats_program(words);
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
  }
  /// Renders `what` into the folder `out`.
  void render(const std::string& what,
              const std::string& out,
              std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"render", path(what), "-o", path(out)});
    call(more);
  }
  /// The frames of a scene file of the run, with more of its text.
  void scene(const std::string& text,
             const std::string& out,
             const std::vector<std::string>& more = {}) const {
    write_file(path("scene.toml"), "[[model]]\nfile = \"run\"\n" + text);
    render("scene.toml", out, more);
  }
  /// The pictures in `out` are these, and those that `model` has of the same names.
  void check_same(const std::string& out,
                  const std::string& model,
                  const Names& names,
                  int side) const {
    CAPTURE(out);
    Names found;
    for (const auto& entry : fs::directory_iterator(path(out)))
      found.insert(entry.path().filename().string());
    CHECK(found == names);
    for (const std::string& name : names) {
      CAPTURE(name);
      const raysplats::Image ours = raysplats::read_image(path(out + "/" + name));
      const raysplats::Image theirs = raysplats::read_image(path(model + "/" + name));
      CHECK(ours.width == side);
      REQUIRE(ours.data.size() == theirs.data.size());
      float most = 0.0f, brightest = 0.0f;
      for (std::size_t i = 0; i < ours.data.size(); ++i) {
        most = std::max(most, std::abs(ours.data[i] - theirs.data[i]));
        if (i % 3 == 0) brightest = std::max(brightest, ours.data[i]);
      }
      CHECK(most <= 1.01f / 255.0f);  // two programs of kernels round their own way
      CHECK(brightest > 0.5f);        // the balls are in sight: red, before a blue of 0.2
    }
  }

 private:
  TemporaryFolder folder_;
};

}  // namespace

TEST_CASE("a scene file is seen by the cameras of a data set as its model is") {
  const Survey survey;
  const std::string data = survey.path("data");
  survey.render("run", "train", {"--data", data, "--split", "train"});
  survey.render("run", "test", {"--data", data});
  survey.render("run", "full", {"--data", data, "--downscale", "1"});

  // The cameras of the command line: origin and size are the run's, or those that are given.
  survey.scene("", "given", {"--data", data});
  survey.check_same("given", "test", {"r_0.png", "r_1.png", "r_2.png"}, 16);
  survey.scene("", "some", {"--data", data, "--split", "train", "--frames", "1:3"});
  survey.check_same("some", "train", {"r_1.png", "r_2.png"}, 16);
  survey.scene("", "large", {"--data", data, "--downscale", "1", "--frames", ":1"});
  survey.check_same("large", "full", {"r_0.png"}, 32);

  // Frames that the scene file names, in whose place the command line's are drawn.
  const std::string camera = "[camera]\ndata = \"data\"\nsplit = \"train\"\nviews = [2, 0]\n";
  survey.scene(camera, "own");
  survey.check_same("own", "train", {"r_0.png", "r_2.png"}, 16);
  survey.scene(camera, "first", {"--frames", ":1"});
  survey.check_same("first", "train", {"r_2.png"}, 16);
  survey.scene("[camera]\ndata = \"data\"\ndownscale = 1\n", "whole");
  survey.check_same("whole", "full", {"r_0.png", "r_1.png", "r_2.png"}, 32);
  survey.scene(camera, "replaced", {"--data", data});
  survey.check_same("replaced", "test", {"r_0.png", "r_1.png", "r_2.png"}, 16);
}
