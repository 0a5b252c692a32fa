// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "barred_photos.hpp"
#include "program.hpp"
#include "raysplats/io.hpp"

namespace {

std::string told(const std::string& path) {
  const Outcome outcome = raysplats_program({"info", path});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  return outcome.out;
}

nlohmann::json json_of(const std::string& path) {
  const Outcome outcome = raysplats_program({"info", path, "--json"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  return nlohmann::json::parse(outcome.out);
}

/// A COLMAP model of two photos by one camera.
void write_photos(const TemporaryFolder& folder, const std::string& camera) {
  write_file(folder / "sparse/0/cameras.txt", "1 " + camera + "\n");
  write_file(folder / "sparse/0/images.txt",
             "1 1 0 0 0 0 0 4 1 a.png\n\n2 1 0 0 0 0.1 0 4 1 b.png\n\n");
  write_file(folder / "sparse/0/points3D.txt", "1 0 0 0 255 0 0 0.5 1 0 2 0\n");
  for (const char* name : {"images/a.png", "images/b.png"}) {
    raysplats::write_image(folder / name, raysplats::Image(8, 6, 3, 0.5f));
  }
}

}  // namespace

TEST_CASE("info says which lenses loading takes out and which it keeps") {
  const std::string undistorted = "undistorted when loaded";
  {
    const TemporaryFolder folder;
    write_photos(folder, "OPENCV_FISHEYE 8 6 10 10 4 3 0.1 0.02 0 0");
    const std::string text = told(folder / "");
    CHECK(contains(text, "fisheye (2 views)"));
    CHECK(contains(text, "kept as they are"));
    CHECK_FALSE(contains(text, undistorted));
    const nlohmann::json json = json_of(folder / "");
    CHECK(json.at("camera_models") == nlohmann::json{{"fisheye", 2}});
    CHECK(json.at("distorted") == true);
    CHECK(json.at("undistorted_when_loaded") == false);
  }
  {
    const TemporaryFolder folder;
    write_photos(folder, "OPENCV 8 6 10 10 4 3 0.1 0.02 0 0");
    CHECK(contains(told(folder / ""), undistorted));
    CHECK(json_of(folder / "").at("camera_models") == nlohmann::json{{"pinhole", 2}});
  }
  {
    const TemporaryFolder folder;
    write_photos(folder, "PINHOLE 8 6 10 10 4 3");
    CHECK_FALSE(contains(told(folder / ""), "distort"));
  }
}

TEST_CASE("info finds black borders unless they are kept, in data sets alone") {
  const TemporaryFolder folder;
  write_barred_photos(folder);
  CHECK(contains(told(folder / ""), "black borders    5 photos"));
  CHECK(json_of(folder / "").at("borders") == 5);
  const Outcome kept = succeed({"info", folder / "", "--borders", "keep"});
  CHECK_FALSE(contains(kept.out, "black border"));
  CHECK_FALSE(contains(kept.err, "black border"));
  check_refused({"info", folder / "", "--borders", "cut"}, 2, "borders");
  write_file(folder / "balls.ply", ply_file(3));
  check_refused({"info", folder / "balls.ply", "--borders", "keep"}, 2, "--borders is about");
}

TEST_CASE("info knows a data set of PNG photos without the library of pictures") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  REQUIRE(raysplats_program(
              {"generate", data, "--size", "8", "--train-views", "3", "--test-views", "1", "-q"})
              .code == 0);
  const Surroundings without{{{"RAYSPLATS_IMAGES", "/nonexistent"}}};
  const Outcome info = raysplats_program({"info", data}, without);
  INFO(info.err);
  CHECK(info.code == 0);
  CHECK(info.out.find("8x8") != std::string::npos);
}

TEST_CASE("info describes meshes, scene files and the header of a model") {
  const TemporaryFolder folder;
  write_file(folder / "wall.obj", "v 0 0 0\nv 2 0 0\nv 0 3 0\nv 2 3 1\nf 1 2 3\nf 2 4 3\n");
  CHECK(contains(told(folder / "wall.obj"), "2 triangles, 4 vertices"));
  const nlohmann::json mesh = json_of(folder / "wall.obj");
  CHECK(mesh.at("type") == "mesh");
  CHECK(mesh.at("triangles") == 2);
  CHECK(mesh.at("bounds") == nlohmann::json::parse("[[0, 0, 0], [2, 3, 1]]"));
  CHECK(mesh.at("normals") == false);
  write_file(folder / "wall.ply",
             "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
             "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
             "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  CHECK(json_of(folder / "wall.ply").at("triangles") == 1);

  write_file(folder / "balls.ply", ply_file(3));
  CHECK(json_of(folder / "balls.ply").at("type") == "model");
  CHECK_FALSE(json_of(folder / "balls.ply").contains("trace"));
  raysplats::TraceOptions trace;
  trace.quantile = 5.5f;
  raysplats::write_ply(folder / "shown.ply", raysplats::read_ply(folder / "balls.ply"), trace);
  CHECK(json_of(folder / "shown.ply").at("trace").at("quantile") == 5.5);
  CHECK(contains(told(folder / "shown.ply"), "entry order, quantile 5.5"));
  trace.background = {0.25f, 0.5f, 1.0f};
  raysplats::write_ply(folder / "shown.ply", raysplats::read_ply(folder / "balls.ply"), trace);
  CHECK(json_of(folder / "shown.ply").at("trace").at("background") ==
        nlohmann::json{0.25, 0.5, 1.0});
  CHECK(contains(told(folder / "shown.ply"), "background       0.25, 0.5, 1\n"));

  write_file(folder / "scene.toml",
             "[[model]]\nfile = \"balls.ply\"\n[[mesh]]\nfile = \"wall.obj\"\n"
             "material = \"chrome\"\n[[material]]\nname = \"chrome\"\nkind = \"mirror\"\n"
             "[[light]]\nkind = \"sphere\"\nposition = [0, 1, 2]\nradius = 0.1\n"
             "[camera]\norbit = { frames = 7 }\n[render]\nsamples = 9\n");
  const std::string text = told(folder / "scene.toml");
  for (const char* part :
       {"balls.ply", "wall.obj", "chrome (mirror)", "sphere", "7 frames", "9 a"}) {
    CAPTURE(part);
    CHECK(contains(text, part));
  }
  const nlohmann::json scene = json_of(folder / "scene.toml");
  CHECK(scene.at("type") == "scene");
  CHECK(scene.at("camera").at("source") == "orbit");
  CHECK(scene.at("lights") == nlohmann::json{"sphere"});
}

TEST_CASE("info describes every kind of file that is read") {
  const TemporaryFolder folder;
  const auto write_array = [&](const std::string& name, const std::string& shape, int count) {
    std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (" + shape + "), }";
    header.resize(117, ' ');
    header += '\n';
    std::string bytes = std::string("\x93NUMPY\x01\x00", 8) + char(header.size()) + '\0' + header;
    bytes.append(static_cast<std::size_t>(4 * count), '\0');
    write_file(folder / name, bytes);
  };
  write_array("rays.npy", "2, 3, 6", 36);
  nlohmann::json json = json_of(folder / "rays.npy");
  CHECK(json["type"] == "rays");
  CHECK(json["rays"] == 6);
  CHECK(json["range"] == nlohmann::json{0.0, 0.0});
  CHECK(contains(told(folder / "rays.npy"), "2, 3, 6"));
  write_array("depth.npy", "4, 5", 20);
  CHECK(json_of(folder / "depth.npy")["type"] == "array");
  const std::string matrix = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
  write_file(folder / "cameras.json",
             "{\"w\":8,\"h\":6,\"fl_x\":5,\"frames\":[{\"file_path\":\"a.png\","
             "\"transform_matrix\":" +
                 matrix + "}]}");
  json = json_of(folder / "cameras.json");
  CHECK(json["type"] == "cameras");
  CHECK(json["cameras"] == 1);
  CHECK(json["sizes"][0]["width"] == 8);
  write_file(folder / "viewer.json",
             "[{\"id\":0,\"width\":8,\"height\":6,\"position\":[0,0,0],\"rotation\":"
             "[[1,0,0],[0,1,0],[0,0,1]]}]");
  json = json_of(folder / "viewer.json");
  CHECK(json["type"] == "cameras of viewers");
  CHECK(json["camera_models"] == nlohmann::json{{"equirectangular", 1}});
  write_file(folder / "metrics.csv", "iteration,psnr\n10,20.5\n20,21\n30,");
  json = json_of(folder / "metrics.csv");
  CHECK(json["type"] == "course of a run");
  CHECK(json["rows"] == 2);
  CHECK(json["columns"] == nlohmann::json{"iteration", "psnr"});
  CHECK(json["iterations"] == 20);
  CHECK(contains(told(folder / "metrics.csv"), "iterations       20\n"));
  write_file(folder / "begun.csv", "iteration,psnr\n");
  json = json_of(folder / "begun.csv");
  CHECK(json["rows"] == 0);
  CHECK(json["columns"] == nlohmann::json{"iteration", "psnr"});
  write_file(folder / "path.toml",
             "seconds = 1\nfps = 4\n[[key]]\neye = [0,0,-5]\ntarget = [0,0,0]\n"
             "[[key]]\neye = [1,0,-5]\ntarget = [0,0,0]\n");
  json = json_of(folder / "path.toml");
  CHECK(json["type"] == "camera path");
  CHECK(json["frames"] == 4);
  write_file(folder / "run.toml", "iterations = 123\n");
  json = json_of(folder / "run.toml");
  CHECK(json["type"] == "configuration");
  CHECK(json["iterations"] == 123);
  CHECK(json["given"] == nlohmann::json{"iterations"});
  write_file(folder / "parts.toml", "iterations = 123\n[train]\nseed = 4\n");
  CHECK(json_of(folder / "parts.toml")["given"] == nlohmann::json{"iterations", "seed"});
  raysplats::write_image(folder / "a.png", raysplats::Image(8, 6, 3, 0.5f));
  json = json_of(folder / "a.png");
  CHECK(json["type"] == "picture");
  CHECK(json["height"] == 6);
  write_file(folder / "damaged.npy", "no array");
  write_file(folder / "damaged.json", "[{}]");
  write_file(folder / "damaged.rsck", "");
  for (const char* name : {"damaged.npy", "damaged.json", "damaged.rsck"}) {
    const Outcome outcome = raysplats_program({"info", folder / name});
    CHECK(outcome.code == 3);
    CHECK(contains(outcome.err, name));
  }
}

TEST_CASE("info says what it reads, and which models a folder without a run holds") {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& path, const std::string& part) {
    check_refused({"info", path}, 3, part);
  };
  write_file(folder / "README.md", "# Notes\n");
  write_file(folder / "metrics.csv", "step,loss\n");
  for (const char* name : {"README.md", "metrics.csv"})
    refused(folder / name, std::string(name) + " is nothing that info reads: those are models");
  write_file(folder / "iteration_60/point_cloud.ply", ply_file(1));
  refused(folder / "iteration_60",
          "neither a run nor a data set: name a file in it, such as point_cloud.ply");
  write_file(folder / "empty/notes.txt", "");
  refused(folder / "empty", "is no data set");
  // One thing is no several things.
  write_file(folder / "wall.obj", "v 0 0 0\nv 2 0 0\nv 0 3 0\nf 1 2 3\n");
  CHECK(contains(told(folder / "wall.obj"), "1 triangle, 3 vertices"));
}

TEST_CASE("info takes captures of LLFF and Polycam for data sets, also with a model beside them") {
  const TemporaryFolder folder;
  write_file(folder / "llff/fused.ply", ply_file(1));
  write_npy(folder / "llff/poses_bounds.npy", "False", "(1, 17)",
            {0, 1, 0, 0, 6, -1, 0, 0, 0, 8, 0, 0, 1, 4, 10, 1, 9});
  write_file(folder / "polycam/keyframes/cameras/1.json",
             R"({"t_00":1,"t_01":0,"t_02":0,"t_03":0,"t_10":0,"t_11":1,"t_12":0,"t_13":0,)"
             R"("t_20":0,"t_21":0,"t_22":1,"t_23":4,"width":8,"height":6,"fx":10,"fy":10,)"
             R"("cx":4,"cy":3})");
  write_file(folder / "polycam/raw.glb", "a mesh of the app");
  for (const char* photo : {"llff/images/1.png", "polycam/keyframes/images/1.png"})
    raysplats::write_image(folder / photo, raysplats::Image(8, 6, 3, 0.5f));
  for (const auto& [name, kind] : {std::pair{"llff", "LLFF"}, std::pair{"polycam", "Polycam"}}) {
    CAPTURE(name);
    const nlohmann::json json = json_of(folder / name);
    CHECK(json.at("type") == "dataset");
    CHECK(json.at("kind") == kind);
    CHECK(json.at("views") == 1);
  }
}

TEST_CASE("info describes the parts of captures, meshes and runs") {
  const TemporaryFolder folder;
  const auto type = [&](const std::string& name) {
    CAPTURE(name);
    return json_of(folder / name).at("type").get<std::string>();
  };
  write_file(folder / "points.ply",
             "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
             "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
             "end_header\n0 0 0 255 0 0\n1 2 3 0 0 255\n");
  nlohmann::json json = json_of(folder / "points.ply");
  CHECK(json.at("type") == "points");
  CHECK(json.at("points") == 2);
  CHECK(json.at("bounds") == nlohmann::json::parse("[[0, 0, 0], [1, 2, 3]]"));
  CHECK(json.at("colours") == true);
  // As programs for meshes write clouds.
  write_file(folder / "cloud.ply",
             "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
             "property float z\nelement face 0\nproperty list uchar int vertex_indices\n"
             "end_header\n1 2 3\n");
  CHECK(type("cloud.ply") == "points");

  write_file(folder / "my ball.mtl",
             "newmtl chrome\nillum 3\nKs 0.9 0.9 0.9\nnewmtl wall\nKd 1 0 0\n");
  json = json_of(folder / "my ball.mtl");
  CHECK(json.at("type") == "materials");
  CHECK(json.at("materials") == nlohmann::json{{"chrome", "mirror"}, {"wall", "diffuse"}});

  // The model of a data set: alone, a file of it, and where the photos are beside it.
  write_photos(folder, "PINHOLE 8 6 10 10 4 3");
  for (const char* name : {"sparse/0", "sparse/0/cameras.txt", "sparse/0/points3D.txt"}) {
    CAPTURE(name);
    json = json_of(folder / name);
    CHECK(json.at("type") == "COLMAP model");
    CHECK(json.at("cameras") == 2);
    CHECK(json.at("points") == 1);
  }
  CHECK(type("") == "dataset");
  for (const char* part : {"cameras.txt", "images.txt", "points3D.txt"})
    std::filesystem::copy(folder / "sparse/0/" + part, folder / part);
  CHECK(type("") == "dataset");

  write_file(folder / "dataparser_transforms.json",
             R"({"transform":[[1,0,0,0],[0,1,0,0],[0,0,1,0]],"scale":0.25})");
  CHECK(json_of(folder / "dataparser_transforms.json").at("scale") == 0.25);
  write_file(folder / "exposures.json", R"({"a":[[1,0,0,0],[0,1,0,0],[0,0,1,0]]})");
  CHECK(json_of(folder / "exposures.json").at("photos") == 1);
  write_file(folder / "eval.json",
             R"({"psnr":30,"ssim":0.9,"images":[{"name":"a"},{"name":"b"}]})");
  CHECK(json_of(folder / "eval.json").at("views") == 2);
  write_file(folder / "metrics.json", R"({"iteration":7,"training_seconds":2,"photos":[]})");
  CHECK(type("metrics.json") == "metrics of a run");
  write_file(folder / "tuning.json",
             R"({"schema":"raysplats-tuning","schema_version":1,"devices":[{"device":"a cpu"}]})");
  CHECK(json_of(folder / "tuning.json").at("devices") == nlohmann::json{"a cpu"});
  write_file(folder / "other.json", R"({"a":1})");
  write_file(folder / "damaged.ply",
             "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
             "end_header\n0\n");
  write_file(folder / "damaged.onnx", "no network");
  write_file(folder / "bench.json", R"({"schema":"raysplats-bench","schema_version":1})");
  write_file(folder / "traced.npz", "PK");
  check_refused({"info", folder / "traced.npz"}, 3, "numpy.load()");
  for (const char* name : {"other.json", "damaged.ply", "damaged.onnx", "bench.json"}) {
    check_refused({"info", folder / name}, 3, name);
  }
}
