// SPDX-License-Identifier: Apache-2.0
#include "view/view_request.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"
#include "scene/camera/camera_model.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using namespace raysplats::view;
using nlohmann::json;

namespace {

json sound_view() {
  return {{"type", "view"},
          {"id", 7},
          {"c2w", {1, 0, 0, 4, 0, 1, 0, 5, 0, 0, 1, 6}},
          {"fov", 90},
          {"size", {400, 200}}};
}

ViewRequest view_of(const json& message, int max_side = 1000) {
  return std::get<ViewRequest>(parse_message(message.dump(), max_side));
}

std::string refusal(const std::string& text) {
  const std::string message = test::message_of<UsageError>([&] { parse_message(text, 1000); });
  CHECK(message.find('\n') == std::string::npos);
  return message;
}

/// The sound message with one member replaced.
std::string with(const char* key, const json& value) {
  json message = sound_view();
  message[key] = value;
  return message.dump();
}

}  // namespace

TEST_CASE("a view message becomes a camera") {
  const ViewRequest request = view_of(sound_view());
  CHECK(request.id == 7);
  CHECK(!request.moving);
  CHECK(request.camera.width == 400);
  CHECK(request.camera.height == 200);
  CHECK(request.camera.fy == doctest::Approx(100));  // 90 degrees of 200 pixels
  CHECK(request.camera.center().x == doctest::Approx(4));
  CHECK(request.camera.center().z == doctest::Approx(6));
  // Sizes beyond the limit keep their shape.
  const ViewRequest small = view_of(sound_view(), 100);
  CHECK(small.camera.width == 100);
  CHECK(small.camera.height == 50);
  json turned = sound_view();
  turned["c2w"] = {0, 0, 1, 0, 0, 1, 0, 0, -1, 0, 0, 0};  // right is -z, forward is x
  turned["moving"] = true;
  turned["near"] = 0.5;
  turned["background"] = {1, 0.5, 0};
  turned["output"] = "depth";
  const ViewRequest other = view_of(turned);
  CHECK(other.moving);
  CHECK(other.camera.rotation[0][2] == doctest::Approx(1));  // forward of world x
  CHECK(*other.near_depth == 0.5f);
  CHECK((*other.background)[1] == 0.5f);
  CHECK(other.output == Output::kDepth);
  CHECK(!other.hit_order);
  turned["order"] = "peak";
  CHECK(view_of(turned).hit_order == HitOrder::kPeak);
  turned["order"] = "entry";
  CHECK(view_of(turned).hit_order == HitOrder::kEntry);
  const std::pair<const char*, Output> outputs[] = {{"color", Output::kColor},
                                                    {"alpha", Output::kAlpha},
                                                    {"normals", Output::kNormals},
                                                    {"hits", Output::kHits}};
  for (const auto& [name, output] : outputs) {
    turned["output"] = name;
    CHECK(view_of(turned).output == output);
  }
}

TEST_CASE("a view may have the lens of a fisheye or show everything around") {
  json message = sound_view();
  message["model"] = "pinhole";
  CHECK(view_of(message).camera.model == CameraModel::kPinhole);
  message["model"] = "fisheye";
  message["fov"] = 270;
  const Camera fisheye = view_of(message).camera;
  CHECK(fisheye.model == CameraModel::kFisheye);
  // Its upper edge is seen 135 degrees off the axis.
  const CameraRay ray = camera_ray(fisheye, 200, 0);
  CHECK(ray.direction.z == doctest::Approx(-std::sqrt(0.5)));
  CHECK(ray.direction.y == doctest::Approx(-std::sqrt(0.5)));
  message["fov"] = 361;
  CHECK(refusal(message.dump()).find("fov") != std::string::npos);
  message["model"] = "equirectangular";
  message.erase("fov");
  CHECK(view_of(message).camera.model == CameraModel::kEquirectangular);
  message["type"] = "scene";
  CHECK(refusal(message.dump()).find("pinhole") != std::string::npos);
  CHECK(refusal(with("fov", 171)).find("fov") != std::string::npos);
  CHECK(refusal(with("model", "pinhol")).find("model") != std::string::npos);
  CHECK(refusal(with("model", 1)).find("model") != std::string::npos);
}

TEST_CASE("picks and commands are understood") {
  json pick = sound_view();
  pick["type"] = "pick";
  pick["px"] = {0.25, 1};
  const auto request = std::get<PickRequest>(parse_message(pick.dump(), 1000));
  CHECK(request.x == 0.25);
  CHECK(request.y == 1.0);
  const auto command = [](const char* text) {
    return std::get<RunCommand>(parse_message(text, 9));
  };
  CHECK(command(R"({"type":"pause"})").kind == RunCommand::Kind::kPause);
  CHECK(command(R"({"type":"resume"})").kind == RunCommand::Kind::kResume);
  CHECK(command(R"({"type":"save"})").kind == RunCommand::Kind::kSave);
  CHECK(command(R"({"type":"share","share":0.25})").kind == RunCommand::Kind::kShare);
  CHECK(command(R"({"type":"share","share":0.25})").share == 0.25);
  CHECK(std::holds_alternative<Leave>(parse_message(R"({"type":"leave"})", 9)));
  for (const char* share : {"-0.1", "0.95", "\"1\"", "null"}) {
    CHECK(refusal(std::string(R"({"type":"share","share":)") + share + "}").find("share") !=
          std::string::npos);
  }
}

TEST_CASE("messages that are not understood are refused in one sentence") {
  for (const std::string text :
       {"", "null", "[]", "{", "{}", R"({"type":7})", R"({"type":"format-disk"})", "\xff\xfe"}) {
    INFO(text);
    CHECK(!refusal(text).empty());
  }
  CHECK(refusal(with("id", "x")).find("id") != std::string::npos);
  CHECK(refusal(with("id", -1)).find("id") != std::string::npos);
  CHECK(refusal(with("fov", 0)).find("fov") != std::string::npos);
  CHECK(refusal(with("fov", 1e300)).find("fov") != std::string::npos);
  CHECK(refusal(with("size", {0, 5})).find("size") != std::string::npos);
  CHECK(refusal(with("size", {5})).find("size") != std::string::npos);
  CHECK(refusal(with("c2w", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 0})).find("rotation") !=
        std::string::npos);
  CHECK(refusal(with("c2w", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0})).find("reflection") !=
        std::string::npos);
  CHECK(refusal(with("c2w", {1, 0, 0, 1e30, 0, 1, 0, 0, 0, 0, 1, 0})).find("c2w") !=
        std::string::npos);
  CHECK(refusal(with("order", "far")).find("order") != std::string::npos);
  CHECK(refusal(with("order", 1)).find("order") != std::string::npos);
  CHECK(refusal(with("near", -1)).find("near") != std::string::npos);
  CHECK(refusal(with("background", {0, 0, 2})).find("background") != std::string::npos);
  CHECK(refusal(with("output", "source code")).find("output") != std::string::npos);
  CHECK(refusal(with("more", std::string(kMaxMessage, 'x'))).find("bytes") != std::string::npos);
  // Deep nesting ends too.
  CHECK(!refusal(std::string(8000, '[')).empty());
  // Every truncation of a sound message is refused.
  const std::string sound = sound_view().dump();
  for (std::size_t length = 0; length < sound.size(); ++length)
    CHECK(!refusal(sound.substr(0, length)).empty());
}

TEST_CASE("messages about meshes are understood, and refused where they are out of range") {
  const json sound = {{"type", "mesh"},       {"format", "glb"},     {"name", "a b.glb"},
                      {"bytes", 100},         {"material", "glass"}, {"at", {1, 2, 3}},
                      {"rotate", {0, 90, 0}}, {"size", 0.5}};
  const auto offer = std::get<MeshOffer>(parse_message(sound.dump(), 9));
  CHECK(offer.format == io::MeshFormat::kGltf);
  CHECK(offer.name == "a b.glb");
  CHECK(offer.bytes == 100);
  CHECK(offer.placement.surface == Surface::kGlass);
  CHECK(offer.placement.at == glm::dvec3(1, 2, 3));
  CHECK(offer.placement.rotate == glm::dvec3(0, 90, 0));
  CHECK(offer.placement.size == 0.5);
  const std::vector<std::pair<const char*, json>> wrong = {{"format", "gltf"},
                                                           {"format", 1},
                                                           {"name", "../a.obj"},
                                                           {"name", "a\nb"},
                                                           {"name", std::string(201, 'x')},
                                                           {"name", ""},
                                                           {"bytes", 0},
                                                           {"bytes", 33554433},
                                                           {"bytes", 1e300},
                                                           {"material", "gold"},
                                                           {"at", {0, 0, 1e7}},
                                                           {"at", {0, 0}},
                                                           {"rotate", {0, 0, 1e5}},
                                                           {"size", 0},
                                                           {"size", -1}};
  for (const auto& [key, value] : wrong) {
    json message = sound;
    message[key] = value;
    INFO(message.dump());
    CHECK(!refusal(message.dump()).empty());
  }
  json place = sound;
  place["type"] = "place";
  place["mesh"] = 3;
  place["moving"] = true;
  const auto placed = std::get<PlaceMesh>(parse_message(place.dump(), 9));
  CHECK(placed.mesh == 3);
  CHECK(placed.moving);
  CHECK(std::get<RemoveMesh>(parse_message(R"({"type":"remove","mesh":4})", 9)).mesh == 4);
  CHECK(!refusal(R"({"type":"remove","mesh":-1})").empty());
  json scene = sound_view();
  scene["type"] = "scene";
  CHECK(std::get<SceneQuestion>(parse_message(scene.dump(), 1000)).camera.width == 400);
}
