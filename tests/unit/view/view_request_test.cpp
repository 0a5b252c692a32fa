// SPDX-License-Identifier: Apache-2.0
#include "view/view_request.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "raysplats/error.hpp"

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
  try {
    parse_message(text, 1000);
  } catch (const UsageError& error) {
    CHECK(std::string(error.what()).find('\n') == std::string::npos);
    return error.what();
  }
  return "";
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
