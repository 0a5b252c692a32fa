// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <string>
#include <vector>

#include "program.hpp"
#include "raysplats/io.hpp"

namespace {

constexpr const char* kCube =
    "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n"
    "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 1 5 8 4\n";

const std::string kModel = "[[model]]\nfile = \"balls.ply\"\n";
const std::string kCamera =
    "[camera]\nposition = [0.5, 0, -6]\ntarget = [0.5, 0, 0]\nwidth = 32\nheight = 32\n";
/// A mirror cube beside the balls, turned so that it shows them.
const std::string kMesh =
    "[[mesh]]\nfile = \"cube.obj\"\nscale = 0.5\ntranslate = [-1.2, 0, 0]\n"
    "rotate = { axis = [0, 1, 0], degrees = 30 }\nmaterial = \"chrome\"\n"
    "[[material]]\nname = \"chrome\"\nkind = \"mirror\"\n"
    "[environment]\ncolor = [0.1, 0.2, 0.6]\n";

void write_scene(const TemporaryFolder& folder, const std::string& text) {
  write_file(folder / "balls.ply", ply_file(3));
  write_file(folder / "cube.obj", kCube);
  write_file(folder / "scene.toml", text);
}

void check_scene_refused(const std::string& text,
                         int code,
                         const std::string& culprit,
                         const std::vector<std::string>& more = {}) {
  const TemporaryFolder folder;
  write_scene(folder, text);
  std::vector<std::string> arguments{"render", folder / "scene.toml", "-q", "-o",
                                     folder / "output"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  check_refused(arguments, code, culprit);
  CHECK(entries(folder / "output") == 0);
}

double difference(const raysplats::Image& a, const raysplats::Image& b) {
  REQUIRE(a.data.size() == b.data.size());
  double sum = 0.0;
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    sum += std::abs(static_cast<double>(a.data[i]) - b.data[i]);
  }
  return sum / static_cast<double>(a.data.size());
}

}  // namespace

TEST_CASE("scene files with mistakes are refused with one sentence") {
  check_scene_refused("[[model]\n", 2, "line 1");
  check_scene_refused("", 2, "shows nothing");
  check_scene_refused(kModel, 2, "[camera]");
  check_scene_refused(kModel + kCamera + "fvo = 40\n", 2, "'fov'");
  check_scene_refused(kModel + kCamera + "[render]\nsamples = \"many\"\n", 2, "line 9");
  check_scene_refused("[[model]]\nfile = \"none.ply\"\n" + kCamera, 3, "none.ply");
  check_scene_refused("[[mesh]]\nfile = \"balls.ply\"\n" + kCamera, 3, "balls.ply");
  check_scene_refused("[[model]]\nfile = \"cube.obj\"\n" + kCamera, 3, "cube.obj");
  const std::string good = kModel + kCamera;
  check_scene_refused(good, 2, "--samples", {"--supersample", "2"});
  check_scene_refused(good, 2, "--near", {"--near", "1"});
  check_scene_refused(good, 2, "--orbit", {"--fov", "30"});
  check_scene_refused(good, 2, "--cameras", {"--cameras", "c.json", "--orbit", "2"});
  check_scene_refused(good, 2, "'1-2'", {"--frames", "1-2"});
  check_scene_refused(good, 2, "none of the 1 frames", {"--frames", "1:"});
  check_scene_refused(good, 3, "none.json", {"--cameras", "none.json"});

  const TemporaryFolder folder;
  const Outcome absent =
      raysplats_program({"render", folder / "absent.toml", "-q", "-o", folder / "output"});
  CHECK(absent.code == 3);
  CHECK(one_sentence(absent));
  write_file(folder / "balls.ply", ply_file(2));
  const Outcome model = raysplats_program(
      {"render", folder / "balls.ply", "--orbit", "2", "--samples", "4", "-o", folder / "output"});
  CHECK(model.code == 2);
  CHECK(one_sentence(model));
  CHECK(model.err.find("--samples") != std::string::npos);
}

TEST_CASE("a scene with a mirror is rendered") {
  const TemporaryFolder folder;
  const auto render = [&](const std::string& text, const std::string& output,
                          const std::vector<std::string>& more = {}) {
    write_scene(folder, text);
    std::vector<std::string> arguments{"render",        folder / "scene.toml", "-o",
                                       folder / output, "--log-level",         "warn"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = raysplats_program(arguments);
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    CHECK(outcome.out.find("million rays per second") != std::string::npos);
    return outcome;
  };
  const auto picture = [&](const std::string& name) {
    const raysplats::Image image = raysplats::read_image(folder / name);
    CHECK(image.width == 32);
    CHECK(image.height == 32);
    return image;
  };
  render(kModel + kMesh + kCamera, "mirror");
  const raysplats::Image mirror = picture("mirror/frame_0000.png");
  CHECK(entries(folder / "mirror") == 1);
  // The environment is blue, the balls are redder than it, and so is what the cube reflects of
  // them.
  CHECK(mirror.at(31, 0, 2) == doctest::Approx(0.6).epsilon(0.01));
  const auto redder = [&](int first, int last) {
    int count = 0;
    for (int y = 0; y < 32; ++y) {
      for (int x = first; x < last; ++x) count += mirror.at(x, y, 0) > 0.2f ? 1 : 0;
    }
    return count;
  };
  CHECK(redder(14, 32) > 10);
  CHECK(redder(0, 10) > 1);
  render(kModel + "[environment]\ncolor = [0.1, 0.2, 0.6]\n" + kCamera, "without");
  CHECK(difference(picture("without/frame_0000.png"), mirror) > 0.001);
  // Paths that end at the mirror are many.
  const Outcome cut = render(kModel + kMesh + kCamera, "cut", {"--max-bounces", "1"});
  CHECK(cut.err.find("ended after --max-bounces 1") != std::string::npos);

  // A turning cube: single frames are those of the whole animation.
  const std::string turning = kModel + kMesh + kCamera + "[animation]\nframes = 3\n";
  const std::string spun = [&] {
    std::string text = turning;
    const std::string key = "material = \"chrome\"\n";
    return text.replace(text.find(key), key.size(),
                        key + "turn = { axis = [0, 1, 0], degrees = 90 }\n");
  }();
  render(spun, "all", {"--format", "exr"});
  CHECK(entries(folder / "all") == 3);
  render(spun, "last", {"--format", "exr", "--frames", "2:"});
  CHECK(entries(folder / "last") == 1);
  CHECK(difference(picture("all/frame_0002.exr"), picture("last/frame_0002.exr")) == 0.0);
  CHECK(difference(picture("all/frame_0000.exr"), picture("all/frame_0002.exr")) > 0.001);

  const Outcome orbit = render(spun, "orbit",
                               {"--orbit", "2", "--width", "16", "--samples", "2", "--seed", "3",
                                "--max-bounces", "2", "--format", "jpg"});
  CHECK(entries(folder / "orbit") == 2);
  CHECK(raysplats::read_image(folder / "orbit/frame_0001.jpg").height == 16);
}

TEST_CASE(
    "depth, normals and hits of a scene file are those of its model until a mesh is before it") {
  const TemporaryFolder folder;
  write_scene(folder, kModel + kCamera);
  write_file(folder / "camera.json",
             R"({"camera_angle_x": 0.9, "w": 48, "h": 48, "frames": [{"file_path": "view.png",
             "transform_matrix": [[1,0,0,0.5],[0,-1,0,0],[0,0,-1,-6],[0,0,0,1]]}]})");
  const auto layers = [&](const std::string& what, const std::string& out) {
    const Outcome outcome =
        raysplats_program({"render", folder / what, "--cameras", folder / "camera.json", "-o",
                           folder / out, "--depth", "--normals", "--hits", "-q"});
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    std::vector<raysplats::Image> read;
    for (const char* layer : {"depth", "normals", "hits"})
      read.push_back(raysplats::read_image(folder / (out + "/view_" + layer + ".png")));
    return read;
  };
  const std::vector<raysplats::Image> model = layers("balls.ply", "model");
  const std::vector<raysplats::Image> scene = layers("scene.toml", "scene");
  for (std::size_t i = 0; i < model.size(); ++i) {
    CAPTURE(i);
    CHECK(difference(scene[i], model[i]) < 0.005);
    double sum = 0.0;
    for (const float value : model[i].data) sum += static_cast<double>(value);
    CHECK(sum > 1.0);
  }
  // A mirror over all of the picture is the nearest, flat, and hides every Gaussian; that its
  // reflection is of the environment alone changes nothing.
  write_file(folder / "cube.obj", "v -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nf 1 2 3 4\n");
  write_file(folder / "scene.toml", kModel +
                                        "[[mesh]]\nfile = \"cube.obj\"\ntranslate = [0.5, 0, -3]\n"
                                        "material = \"chrome\"\n[[material]]\nname = \"chrome\"\n"
                                        "kind = \"mirror\"\n" +
                                        kCamera);
  const std::vector<raysplats::Image> mirror = layers("scene.toml", "mirror");
  for (std::size_t i = 0; i < 48u * 48u; ++i) {
    CHECK(mirror[0].data[i] == 1.0f);
    CHECK(mirror[1].data[3 * i + 2] == 1.0f);
    CHECK(mirror[2].data[i] == 0.0f);
  }
}
