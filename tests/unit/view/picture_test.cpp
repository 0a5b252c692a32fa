// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "view/pace.hpp"
#include "view/page.hpp"
#include "view/picture_file.hpp"
#include "view/sampling.hpp"
#include "view/view_state.hpp"

using namespace raysplats;
using namespace raysplats::view;

TEST_CASE("pictures of a movement become as large as their time allows") {
  Camera camera;
  camera.width = 1600;
  camera.height = 1200;
  camera.fx = camera.fy = 1000;
  camera.cx = 800;
  camera.cy = 600;
  // A tracer of a million pixels a second, and one that needs 20 ms for any picture beside.
  for (const double fixed : {0.0, 0.02}) {
    Pace pace(0.1);
    for (int i = 0; i < 40; ++i) {
      const Camera sized = pace.sized(camera);
      const double pixels = static_cast<double>(sized.width) * sized.height;
      pace.record(pixels, fixed + 1e-6 * pixels);
    }
    const Camera sized = pace.sized(camera);
    const double seconds = fixed + 1e-6 * sized.width * sized.height;
    CHECK(seconds == doctest::Approx(0.1).epsilon(0.2));
    CHECK(sized.width * 3 == doctest::Approx(sized.height * 4).epsilon(0.02));
    CHECK(sized.fx / sized.width == doctest::Approx(camera.fx / camera.width).epsilon(0.01));
  }
  // Where any picture takes longer than that, they do not shrink to nothing for it.
  Pace large(0.1);
  for (int i = 0; i < 60; ++i) {
    const Camera sized = large.sized(camera);
    const double pixels = static_cast<double>(sized.width) * sized.height;
    const double noise = 1.0 + 0.1 * std::sin(7.0 * i);
    large.record(pixels, noise * (0.15 + 1e-6 * pixels));
  }
  const Camera shown = large.sized(camera);
  CHECK(1e-6 * shown.width * shown.height > 0.025);
  CHECK(1e-6 * shown.width * shown.height < 0.1);
  Pace quick(0.1);
  for (int i = 0; i < 60; ++i) quick.record(1e6, 1e-4);
  CHECK(quick.sized(camera).width == 1600);
  Pace slow(0.1);
  for (int i = 0; i < 60; ++i) slow.record(1e3, 10.0);
  CHECK(slow.sized(camera).height >= 40);
}

TEST_CASE("a picture's message says what it is") {
  const Image rgba(6, 4, 4, 0.5f);
  PictureHeader header;
  header.view = 9;
  header.samples = 3;
  header.last = true;
  header.iteration = 1000;
  header.milliseconds = 2.5f;
  const auto word = [](const std::vector<std::byte>& bytes, std::size_t index) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + 4 * index, 4);
    return value;
  };
  const std::vector<std::byte> jpeg = picture_message(header, rgba, 80);
  REQUIRE(jpeg.size() > kPictureHeader + 2);
  CHECK(std::memcmp(jpeg.data(), "RSVF", 4) == 0);
  CHECK(word(jpeg, 1) == 9);
  CHECK(word(jpeg, 2) == 6);
  CHECK(word(jpeg, 3) == 4);
  CHECK(word(jpeg, 4) == 3);
  CHECK(word(jpeg, 5) == 1);
  CHECK(word(jpeg, 6) == 1000);
  CHECK(jpeg[kPictureHeader] == std::byte{0xff});
  CHECK(jpeg[kPictureHeader + 1] == std::byte{0xd8});
  header.png = true;
  const std::vector<std::byte> png = picture_message(header, rgba, 80);
  CHECK(word(png, 5) == 3);
  CHECK(std::memcmp(png.data() + kPictureHeader, "\x89PNG", 4) == 0);
}

TEST_CASE("depths become grey between the nearest and the farthest") {
  Image depth(3, 1, 3);
  Image rgba(3, 1, 4, 1.0f);
  depth.at(0, 0, 0) = 2.0f;
  depth.at(1, 0, 0) = 4.0f;
  rgba.at(2, 0, 3) = 0.0f;
  const Image grey = depth_picture(depth, rgba);
  CHECK(grey.at(0, 0, 0) == 1.0f);
  CHECK(grey.at(1, 0, 1) == 0.0f);
  CHECK(grey.at(2, 0, 2) == 0.0f);
}

TEST_CASE("normals and numbers of hits become opaque pictures") {
  Image sums(1, 1, 3);
  sums.data = {0, 0, -0.5f};
  const Image colors = normals_picture(sums, Image(1, 1, 4, 1.0f), Camera{});
  CHECK(colors.data == std::vector<float>{0.5f, 0.5f, 1, 1});
  Image depth(2, 1, 3);
  depth.at(0, 0, 2) = 3.0f;
  depth.at(1, 0, 2) = 6.0f;
  const Image hits = hits_picture(depth);
  CHECK(hits.data == std::vector<float>{0.5f, 0.5f, 0.5f, 1, 1, 1, 1, 1});
}

TEST_CASE("the library holds the page, and nothing else is served") {
  REQUIRE(page_file("/").has_value());
  CHECK(page_file("/")->content.find("<!doctype html>") == 0);
  CHECK(page_file("/app.js")->type == "text/javascript; charset=utf-8");
  CHECK(page_file("/style.css")->type == "text/css; charset=utf-8");
  for (const char* path : {"", "/..", "/../app.js", "//app.js", "/etc/passwd", "/app.js/", "/x.js"})
    CHECK(!page_file(path).has_value());
  // No script, style or picture from elsewhere.
  for (const char* path :
       {"/", "/app.js", "/style.css", "/connection.js", "/cameras.js", "/keyframes.js", "/path.js",
        "/pointers.js", "/vectors.js", "/camera.js", "/run.js", "/curves.js", "/photo.js",
        "/crop.js", "/meshes.js", "/toml.js"}) {
    INFO(path);
    REQUIRE(page_file(path).has_value());
    CHECK(page_file(path)->content.find("https:") == std::string::npos);
    CHECK(page_file(path)->content.find("http:") == std::string::npos);
  }
}

TEST_CASE("the page learns what it starts with") {
  ViewState state;
  state.name = "fox <b>\xff";
  state.start = look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 200, 100, 50);
  const std::vector<Camera> cameras{state.start};
  state.cameras = cameras;
  state.has_near = true;
  state.has_photos = true;
  state.origin = {4321012.125, -0.1, 1e-9};
  const nlohmann::json json = nlohmann::json::parse(state_json(state));
  CHECK(json["start"]["fov"] == doctest::Approx(90));
  CHECK(json["start"]["aspect"] == 2);
  CHECK(json["start"]["c2w"].size() == 12);
  CHECK(json["start"]["c2w"][11] == doctest::Approx(-4));
  CHECK(json["cameras"].size() == 1);
  CHECK(json["cameras"][0]["photo"] == true);
  CHECK(json["cameras"][0]["shift"] == nlohmann::json{0.0, 0.0});
  // A lens whose middle is off, with pixels twice as high as wide.
  Camera odd = state.start;
  odd.cx = 90;
  odd.cy = 52;
  odd.fx = 100;
  const std::vector<Camera> others{odd};
  state.cameras = others;
  const nlohmann::json off = nlohmann::json::parse(state_json(state))["cameras"][0];
  CHECK(off["aspect"] == doctest::Approx(1));
  CHECK(off["shift"][0] == doctest::Approx(0.05));
  CHECK(off["shift"][1] == doctest::Approx(-0.02));
  odd.model = CameraModel::kFisheye;
  const std::vector<Camera> fisheyes{odd};
  state.cameras = fisheyes;
  CHECK(nlohmann::json::parse(state_json(state))["cameras"][0]["photo"] == false);
  CHECK(json["up"] == nlohmann::json{0, -1, 0});
  CHECK(json["has_near"] == true);
  // In double precision, which surveyed coordinates need.
  CHECK(json["origin"] == nlohmann::json{4321012.125, -0.1, 1e-9});
}
