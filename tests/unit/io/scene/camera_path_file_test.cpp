// SPDX-License-Identifier: Apache-2.0
#include "io/scene/camera_path_file.hpp"

#include <doctest/doctest.h>
#include <unistd.h>

#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <nlohmann/json.hpp>
#include <string>

#include "raysplats/error.hpp"
#include "unit/log_capture.hpp"
#include "unit/temporary_directory.hpp"
#include "util/atomic_file.hpp"

using namespace raysplats;
using nlohmann::json;

namespace {

class Folder {
 public:
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    write_text_file(folder_ / name, text);
    return folder_ / name;
  }

 private:
  TemporaryDirectory folder_;
};

/// OpenGL axes at x, 2, 3, looking along -z of the world.
json matrix_at(double x) { return {1, 0, 0, x, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1}; }

json key_file(const json& first, const json& second) {
  return {{"camera_type", "perspective"},
          {"render_width", 80},
          {"render_height", 60},
          {"fps", 10},
          {"seconds", 1.1},
          {"keyframes", {{{"matrix", first}, {"fov", 60}}, {{"matrix", second}, {"fov", 60}}}}};
}

/// The sentence with which a file is refused.
std::string refusal(const std::filesystem::path& path, const PathOptions& options = {}) {
  try {
    read_camera_path(path, options);
  } catch (const Error& error) {
    CHECK((error.code() == ErrorCode::kData || error.code() == ErrorCode::kUsage));
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("keyframes of nerfstudio are read, as numbers by rows and as text by columns") {
  const Folder folder;
  // The same pose three ways; the last as the add-ons write it.
  const json nested{{1, 0, 0, 4}, {0, 1, 0, 2}, {0, 0, 1, 3}, {0, 0, 0, 1}};
  const std::string text = "[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4.0, 2, 3e0, 1]";
  for (const json& second : {matrix_at(4), nested, json(text)}) {
    CAPTURE(second.dump());
    const auto path = folder.write("path.json", key_file(matrix_at(0), second).dump());
    const CameraPathFile file = read_camera_path(path, {});
    REQUIRE(file.cameras.size() == 11);
    CHECK(file.fps == 10);
    CHECK(!file.closed);
    const Camera& last = file.cameras.back();
    CHECK(glm::distance(last.center(), glm::dvec3(4, 2, 3)) < 1e-9);
    CHECK(file.cameras[5].center().x == doctest::Approx(2));
    // Up is y and forward is -z there; rows are y down and z forward here.
    CHECK(glm::distance(glm::transpose(last.rotation)[1], glm::dvec3(0, -1, 0)) < 1e-9);
    CHECK(glm::distance(glm::transpose(last.rotation)[2], glm::dvec3(0, 0, -1)) < 1e-9);
    CHECK(last.width == 80);
    CHECK(last.fy == doctest::Approx(30 / std::tan(30 * 3.14159265358979 / 180)));
    CHECK(last.name == "frame_0010");
  }
}

TEST_CASE("frames of a camera path are taken as they are, unless other moments are asked for") {
  const Folder folder;
  json file = key_file(matrix_at(0), matrix_at(9));
  for (int i = 0; i < 5; ++i)
    file["camera_path"].push_back({{"camera_to_world", matrix_at(i * i)}, {"fov", 50}});
  const auto path = folder.write("path.json", file.dump());
  CameraPathFile read = read_camera_path(path, {});
  REQUIRE(read.cameras.size() == 5);
  CHECK(read.cameras[3].center().x == doctest::Approx(9));
  PathOptions options;
  options.fps = 20;
  read = read_camera_path(path, options);
  CHECK(read.cameras.size() == 10);
  CHECK(read.fps == 20);
  options = {};
  options.seconds = 0.9;
  options.width = 40;
  read = read_camera_path(path, options);
  REQUIRE(read.cameras.size() == 9);
  CHECK(read.cameras[6].center().x == doctest::Approx(9));
  CHECK(read.cameras[6].height == 30);
  options = {};
  options.constant_speed = true;
  read = read_camera_path(path, options);
  REQUIRE(read.cameras.size() == 5);
  CHECK(read.cameras[2].center().x == doctest::Approx(8).epsilon(0.01));
  file["camera_type"] = "equirectangular";
  file["is_cycle"] = true;
  read = read_camera_path(folder.write("round.json", file.dump()), {});
  CHECK(read.closed);
  CHECK(read.cameras[0].model == CameraModel::kEquirectangular);
  CHECK(read.cameras[0].fx == 40);
}

TEST_CASE("seconds of nerfstudio's keyframes are those of the way to them") {
  const Folder folder;
  json file = key_file(matrix_at(0), matrix_at(4));
  file.erase("seconds");
  file["keyframes"].push_back({{"matrix", matrix_at(8)}, {"fov", 60}});
  file["keyframes"][1]["override_transition_enabled"] = true;
  file["keyframes"][1]["override_transition_sec"] = 3;
  file["default_transition_sec"] = 1;
  CameraPathFile read = read_camera_path(folder.write("open.json", file.dump()), {});
  // 3 s to the second and 1 s to the third; the 40 frames lie 4/39 s apart.
  REQUIRE(read.cameras.size() == 40);
  CHECK(read.cameras[29].center().x < 4);
  CHECK(read.cameras[30].center().x > 4);
  // 2 s from the third back to the first.
  file["is_cycle"] = true;
  file["keyframes"][0]["override_transition_enabled"] = true;
  file["keyframes"][0]["override_transition_sec"] = 2;
  read = read_camera_path(folder.write("closed.json", file.dump()), {});
  REQUIRE(read.cameras.size() == 60);
  CHECK(read.cameras[30].center().x == doctest::Approx(4));
  CHECK(read.cameras[40].center().x == doctest::Approx(8));
}

TEST_CASE("nerfstudio's transform is undone") {
  const Folder folder;
  const auto path = folder.write("path.json", key_file(matrix_at(0), matrix_at(4)).dump());
  // x' = 2 (R x + t), R a quarter turn about z.
  const auto transform =
      folder.write("dataparser_transforms.json",
                   R"({"transform": [[0,-1,0,1],[1,0,0,0],[0,0,1,-1]], "scale": 2})");
  PathOptions options;
  options.transform = transform;
  const Camera camera = read_camera_path(path, options).cameras.back();
  const glm::dvec3 x = camera.center();
  CHECK(glm::distance(2.0 * glm::dvec3(-x.y + 1, x.x, x.z - 1), glm::dvec3(4, 2, 3)) < 1e-9);
  CHECK(glm::distance(glm::transpose(camera.rotation)[2], glm::dvec3(0, 0, -1)) < 1e-9);
  CHECK(glm::distance(glm::transpose(camera.rotation)[0], glm::dvec3(0, -1, 0)) < 1e-9);
  // A data set whose own coordinates are y = 0.5 (A x + (1, 2, 3)), A a quarter turn about x: the
  // file above is of x, and so is what has been found, so y is where the model of that set has it.
  options.data_transform = folder.write(
      "transforms.json",
      R"({"applied_transform": [[1,0,0,1],[0,0,-1,2],[0,1,0,3]], "applied_scale": 0.5})");
  const glm::dvec3 y = read_camera_path(path, options).cameras.back().center();
  // x' = 2 / 0.5 * (T y), where T of (A x + (1, 2, 3)) is R x + t.
  const glm::dvec3 x4(4.0 / 4 - 1, 2.0 / 4, 3.0 / 4 + 1);  // R x
  const glm::dvec3 own(x4.y, -x4.x, x4.z);                 // x
  CHECK(glm::distance(y, glm::dvec3(own.x + 1, -own.z + 2, own.y + 3)) < 1e-9);
}

TEST_CASE("that nerfstudio's crop is not drawn is said, where a path has one") {
  const Folder folder;
  json file = key_file(matrix_at(0), matrix_at(4));
  for (const json& crop : {json(), json{{"crop_center", {0, 0, 0}}, {"crop_scale", {1, 1, 1}}}}) {
    CAPTURE(crop.dump());
    file["crop"] = crop;
    const LogCapture log;
    CHECK(read_camera_path(folder.write("path.json", file.dump()), {}).cameras.size() == 11);
    CHECK(log.contains("crops the scene") == !crop.is_null());
  }
}

TEST_CASE("a fov that no pinhole has is refused, of fisheyes with nerfstudio's convention") {
  const Folder folder;
  json file = key_file(matrix_at(0), matrix_at(4));
  for (const double fov : {180.0, 200.0, 359.5}) {
    CAPTURE(fov);
    file["keyframes"][1]["fov"] = fov;
    const auto said = [&](const char* type) {
      file["camera_type"] = type;
      return refusal(folder.write("path.json", file.dump()));
    };
    CHECK(said("perspective").find("at most 179.9 degrees") != std::string::npos);
    CHECK(said("perspective").find("fisheye") == std::string::npos);
    CHECK(said("fisheye").find("pinhole with its focal length") != std::string::npos);
    CHECK(said("equirectangular").empty());
  }
  file["keyframes"][1].erase("fov");
  file["default_fov"] = 360;
  CHECK(refusal(folder.write("path.json", file.dump())).empty());  // of panoramas, whose it is
  file["camera_type"] = "perspective";
  CHECK(refusal(folder.write("path.json", file.dump())).find("'default_fov' 360 where at most") !=
        std::string::npos);
}

TEST_CASE("keyframes in TOML are eye, target, up, angle and seconds") {
  const Folder folder;
  const auto path = folder.write("path.toml", R"(
fps = 8
closed = true
width = 64
height = 48
[[key]]
eye = [4, 0, 0]
target = [0, 0, 0]
up = [0, 0, 1]
seconds = 1.5
[[key]]
eye = [0, 4, 0]
target = [0, 0, 0]
up = [0, 0, 1]
fov = 30
seconds = 0.5
)");
  const CameraPathFile file = read_camera_path(path, {});
  REQUIRE(file.cameras.size() == 16);
  CHECK(file.closed);
  CHECK(glm::distance(file.cameras[0].center(), glm::dvec3(4, 0, 0)) < 1e-9);
  CHECK(glm::distance(file.cameras[12].center(), glm::dvec3(0, 4, 0)) < 1e-9);
  CHECK(glm::distance(glm::transpose(file.cameras[12].rotation)[2], glm::dvec3(0, -1, 0)) < 1e-9);
  CHECK(glm::distance(glm::transpose(file.cameras[12].rotation)[1], glm::dvec3(0, 0, -1)) < 1e-9);
  CHECK(file.cameras[12].fy > 1.5 * file.cameras[0].fy);
  CHECK(refusal(folder.write("a.toml", "fps = 8\n")).find("[[key]]") != std::string::npos);
  CHECK(refusal(folder.write("b.toml", "[[key]]\neye = [0, 0, 1]\n")).find("target") !=
        std::string::npos);
  CHECK(refusal(folder.write("c.toml", "[[key]]\neye = [0, 1, 0]\ntarget = [0, 0, 0]\n"))
            .find("c.toml, line 1: 'up' in [[key]] is along the view") != std::string::npos);
  CHECK(refusal(folder.write("b.toml", "[[key]]\ntarget = [0, 0, 1]\n"))
            .find("line 1: 'eye' in [[key]] is missing") != std::string::npos);
  CHECK(refusal(folder.write("e.toml", "[[key]]\neye = [0, 0, 1]\ntarget = [0, 0, 1]\n"))
            .find("'eye' and 'target' in [[key]] are the same point") != std::string::npos);
  // However near the target is.
  const auto tiny =
      folder.write("f.toml", "fps = 1\n[[key]]\neye = [0, 0, 0]\ntarget = [0, 0, 1e-10]\n");
  CHECK(read_camera_path(tiny, {}).cameras.size() == 1);
  CHECK(refusal(folder.write("g.toml", "[[key]]\neye = [0, 1e9, 0]\ntarget = [0, 0, 0.1]\n"))
            .find("along the view") != std::string::npos);
  CHECK(refusal(folder.write("d.toml", "fsp = 8\n")).find("fsp") != std::string::npos);
}

TEST_CASE("what is no path is refused with one sentence") {
  const Folder folder;
  const auto refused = [&](const json& file) {
    const std::string said = refusal(folder.write("path.json", file.dump()));
    CHECK(said.find('\n') == std::string::npos);
    return said;
  };
  json file = key_file(matrix_at(0), matrix_at(4));
  CHECK(refused({{"frames", json::array()}}).find("keyframes") != std::string::npos);
  for (const json& wrong :
       {json("1 2 3"), json::array({1, 2}), json(7), json(nullptr), json(std::string(99, '1'))}) {
    file["keyframes"][0]["matrix"] = wrong;
    CHECK(refused(file).find("matrix") != std::string::npos);
  }
  json mirrored = matrix_at(0);
  mirrored[0] = -1;
  CHECK(refused(key_file(mirrored, matrix_at(4))).find("reflection") != std::string::npos);
  mirrored[0] = 2;
  CHECK(refused(key_file(mirrored, matrix_at(4))).find("rigid") != std::string::npos);
  // By columns, as three.js stores matrices.
  const json transposed{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4, 2, 3, 1};
  const json text("[1, 0, 0, 4, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1]");
  for (const json& matrix : {transposed, text})
    CHECK(refused(key_file(matrix_at(0), matrix)).find("seems transposed") != std::string::npos);
  json frames = key_file(matrix_at(0), matrix_at(4));
  frames.erase("keyframes");
  frames["camera_path"] = {{{"camera_to_world", transposed}, {"fov", 60}}};
  CHECK(refused(frames).find("seems transposed") != std::string::npos);
  json projective = matrix_at(0);
  projective[14] = 0.5;
  const std::string other = refused(key_file(projective, matrix_at(4)));
  CHECK(other.find("last row") != std::string::npos);
  CHECK(other.find("transposed") == std::string::npos);
  for (const auto& [key, value] : {std::pair<const char*, json>{"fps", 0},
                                   {"fps", "x"},
                                   {"seconds", -1},
                                   {"render_width", 1e9},
                                   {"camera_type", "vr180"}}) {
    file = key_file(matrix_at(0), matrix_at(4));
    file[key] = value;
    CAPTURE(key);
    CHECK(!refused(file).empty());
  }
  // A small file cannot ask for any number of frames.
  file = key_file(matrix_at(0), matrix_at(4));
  file["seconds"] = 86400;
  file["fps"] = 1000;
  CHECK(refused(file).find("fewer") != std::string::npos);
}
