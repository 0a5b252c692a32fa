// SPDX-License-Identifier: Apache-2.0
#include "io/model/convert_model.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>

#include "io/model/gaussian_codes.hpp"
#include "io/model/model_file.hpp"
#include "scene/gaussians/gaussian_transform.hpp"
#include "scene/morton_order.hpp"
#include "unit/io/model_bytes.hpp"

using namespace raysplats;
using namespace raysplats::test;

TEST_CASE("a file is what its first bytes say") {
  const Scratch scratch;
  const Gaussians model = trained_like(3, 1);
  write_model(scratch / "a.spz", model);
  fs::rename(scratch / "a.spz", scratch / "spz.bin");
  CHECK(read_model(scratch / "spz.bin").size() == 3);
  write_model(scratch / "a.glb", model);
  fs::rename(scratch / "a.glb", scratch / "glb.ply");
  CHECK(read_model(scratch / "glb.ply").sh_degree == 1);
  write_model(scratch / "a.ply", model);
  CHECK(read_model(scratch / "a.ply").sh == model.sh);
  write_bytes(scratch / "a.txt", "hello");
  CHECK(contains(data_error([&] { read_model(scratch / "a.txt"); }), "no model that is known"));
  CHECK(contains(data_error([&] { read_model(scratch / "none.spz"); }), "does not exist"));
  for (const char* name : {"a.obj", "a", "a.compressed.spz.x", "a.gltf"})
    CHECK(contains(message_of<UsageError>([&] { write_model(scratch / name, model); }), ".splat"));
}

TEST_CASE("conversion moves, crops and thins in the stated order") {
  Gaussians model = trained_like(4, 2);
  model.means = {1, 0, 0, 0, 1, 0, 0, 0, 1, 5, 5, 5};
  model.opacities = {3, 3, -4, 3};
  ModelChanges changes;
  changes.min_opacity = 0.5;
  changes.scale = 2.0;
  changes.rotate_degrees = {0, 0, 90};
  changes.translate = {0, 0, 1};
  changes.crop = Bounds{{-4, -4, -4}, {4, 4, 4}};
  changes.sh_degree = 1;
  const Gaussians out = changed(model, changes);
  REQUIRE(out.size() == 2);
  CHECK(out.sh_degree == 1);
  CHECK(farthest(out.means, {0, 2, 1, -2, 0, 1}) < 1e-6);
  CHECK(out.log_scales[0] == doctest::Approx(model.log_scales[0] + std::log(2.0)));
  CHECK(changed(model, {}).sh == model.sh);
}

TEST_CASE("conversion turns what is up to -y, harmonics as well") {
  Gaussians model = trained_like(2, 1);
  model.means = {0, 0, 2, 1, 0, 0};
  ModelChanges changes;
  changes.up = glm::dvec3(0, 0, 5);
  const Gaussians out = changed(model, changes);
  CHECK(farthest(out.means, {0, -2, 0, 1, 0, 0}) < 1e-6);
  // Degree 1 is -y, z, -x of the direction: z goes to -y, which is stored with its sign turned.
  for (std::size_t c = 0; c < 3; ++c) {
    CHECK(out.sh[3 + c] == doctest::Approx(model.sh[6 + c]));
    CHECK(out.sh[9 + c] == doctest::Approx(model.sh[9 + c]));
  }
  changes.up = glm::dvec3(0, -3, 0);
  CHECK(changed(model, changes).means == model.means);
  changes.up = glm::dvec3(0, 3, 0);
  CHECK(farthest(changed(model, changes).means, {0, 0, -2, 1, 0, 0}) < 1e-6);
  changes.up = glm::dvec3(0.3, -0.4, 0.5);
  Gaussians pointer = trained_like(1, 0);
  pointer.means = {0.3f, -0.4f, 0.5f};
  const double length = std::sqrt(0.5);
  CHECK(farthest(changed(pointer, changes).means, {0, static_cast<float>(-length), 0}) < 1e-6);
  for (const double length : {1e-200, 1e200}) {
    changes.up = glm::dvec3(0, 0, length);
    CHECK(farthest(changed(model, changes).means, {0, -2, 0, 1, 0, 0}) < 1e-6);
  }
  const auto refused = [&](const glm::dvec3& up) {
    changes.up = up;
    return message_of<UsageError>([&] { changed(model, changes); });
  };
  CHECK(contains(refused(glm::dvec3(0.0)), "up 0,0,0 is no direction"));
  CHECK(contains(refused({1, HUGE_VAL, 0}), "up 1,inf,0 is no direction"));
}

TEST_CASE("changes out of range are refused, and half a box is half of space") {
  Gaussians model = trained_like(2, 1);
  model.means = {-1, 0, 0, 1, 0, 0};
  const auto refused = [&](const auto& change) {
    ModelChanges changes;
    change(changes);
    return message_of<UsageError>([&] { changed(model, changes); });
  };
  CHECK(contains(refused([](ModelChanges& c) { c.scale = 0.0; }), "scale is above 0"));
  CHECK(contains(refused([](ModelChanges& c) { c.scale = std::nan(""); }), "scale is above 0"));
  for (const double scale : {1e300, 1e-300})
    CHECK(contains(refused([&](ModelChanges& c) { c.scale = scale; }), "scale is 1e-30 to 1e+30"));
  CHECK(contains(refused([](ModelChanges& c) { c.min_opacity = 1.5; }), "min-opacity is 0 to 1"));
  CHECK(contains(refused([](ModelChanges& c) { c.sh_degree = 5; }), "sh-degree is 0 to 4"));
  CHECK(!refused([](ModelChanges& c) { c.translate.x = HUGE_VAL; }).empty());
  CHECK(contains(refused([](ModelChanges& c) {
                   c.crop = Bounds{{0, 2, 0}, {1, 1, 1}};
                 }),
                 "its least y is 2 and its greatest 1: swap them"));
  ModelChanges half;
  half.crop.emplace().low[0] = 0.0;
  REQUIRE(changed(model, half).size() == 1);
  CHECK(changed(model, half).means[0] == 1.0f);
}

TEST_CASE("conversion keeps those that contribute most, in their order") {
  Gaussians model = trained_like(4, 0);
  model.opacities = {0, 5, 0, -20};
  // Discs whose thickness has no part in it.
  model.log_scales = {-1, -1, -9, -1, -9, -1, -2, -3, -2, 3, 3, 3};
  for (std::size_t i = 0; i < 4; ++i) model.means[3 * i] = static_cast<float>(i);
  ModelChanges changes;
  changes.max_gaussians = 2;
  const Gaussians two = changed(model, changes);
  REQUIRE(two.size() == 2);
  CHECK(two.means[0] == 0.0f);
  CHECK(two.means[3] == 1.0f);
  changes.max_gaussians = 3;
  CHECK(changed(model, changes).means[6] == 2.0f);
  changes.max_gaussians = 9;
  CHECK(changed(model, changes).means == model.means);
}

TEST_CASE("conversion refuses what would be lost") {
  const Scratch scratch;
  write_model(scratch / "a.ply", trained_like(3, 0));
  const auto convert = [&](const char* to, const ModelChanges& changes, bool overwrite) {
    return convert_model(scratch / "a.ply", scratch / to, changes, {}, std::nullopt, overwrite);
  };
  const Conversion done = convert("b.splat", {}, false);
  CHECK(done.written == 3);
  CHECK(contains(done.losses, "8 bits"));
  CHECK(contains(message_of<UsageError>([&] { convert("b.splat", {}, false); }), "--overwrite"));
  CHECK(convert("b.splat", {}, true).read == 3);
  CHECK(contains(message_of<UsageError>([&] { convert("a.ply", {}, true); }), "what is read"));
  ModelChanges fewer;
  fewer.max_gaussians = 2;
  CHECK(convert("c.ply", {}, false).losses == "nothing is lost");
  CHECK(contains(convert("c.ply", fewer, true).losses, "nothing but what was asked for"));
  fs::remove(scratch / "c.ply");
  ModelChanges nothing;
  nothing.crop = Bounds{{100, 100, 100}, {101, 101, 101}};
  CHECK(
      contains(message_of<UsageError>([&] { convert("c.ply", nothing, false); }), "None of the 3"));
  CHECK(!fs::exists(scratch / "c.ply"));
}

TEST_CASE("conversion names what only the header of our PLY says") {
  const Scratch scratch;
  write_model(scratch / "a.ply", trained_like(3, 1));
  const auto told = [&](const char* to, const std::optional<TraceOptions>& trace) {
    return convert_model(scratch / "a.ply", scratch / to, {}, {}, trace, true).losses;
  };
  TraceOptions trace = peak_order();
  // What a reader of a file that says nothing takes is not lost.
  CHECK(told("b.glb", trace) == "nothing is lost");
  CHECK(told("b.glb", std::nullopt) == "nothing is lost");
  trace.background = {1, 1, 1};
  CHECK(told("b.ply", trace) == "nothing is lost");
  CHECK(contains(told("b.glb", trace), "give --background 1,1,1 to render it"));
  CHECK(!contains(told("b.glb", trace), "nothing is lost"));
  trace.hit_order = HitOrder::kEntry;
  trace.adaptive_radius = false;
  trace.quantile = 9.5f;
  trace.near_depth = 0.25f;
  trace.min_transmittance = 0.5f;
  trace.max_hits = 77;
  trace.memory_budget = std::size_t{17} << 20;  // shows nothing else
  for (const char* name : {"b.glb", "b.spz", "b.sog", "b.splat", "b.compressed.ply"}) {
    CAPTURE(name);
    CHECK(contains(told(name, trace),
                   "give --hit-order entry --quantile 9.5 --no-adaptive-radius --near 0.25 "
                   "--min-transmittance 0.5 --max-hits 77 --background 1,1,1 to render it"));
  }
  trace = peak_order();
  trace.background = {1, 1, 1};
  trace.sky = {{0.5f, 0.5f, 0.5f}};
  CHECK(contains(told("b.glb", trace), "the sky behind the model is not said"));
  CHECK(!contains(told("b.glb", trace), "--background"));
}

TEST_CASE("conversion scales the near depth that the header says as the model") {
  const Scratch scratch;
  TraceOptions trace;
  trace.near_depth = 0.25f;
  write_model(scratch / "a.ply", trained_like(3, 0), {}, trace);
  ModelChanges changes;
  changes.scale = 10;
  convert_model(scratch / "a.ply", scratch / "b.ply", changes, {},
                read_ply_options(scratch / "a.ply"), false);
  CHECK(read_ply_options(scratch / "b.ply")->near_depth == 2.5f);
  trace.near_depth = 1e10f;
  changes.scale = 1e30;
  CHECK(contains(message_of<UsageError>([&] {
                   convert_model(scratch / "a.ply", scratch / "b.ply", changes, {}, trace, true);
                 }),
                 "near depth of"));
}

TEST_CASE("the origin of a model scales and turns with it") {
  const Scratch scratch;
  Gaussians model = trained_like(2, 0);
  for (std::size_t i = 0; i < 6; ++i) model.means[i] = static_cast<float>(i);
  write_model(scratch / "a.ply", model, {}, std::nullopt, {1000, 200, 0});
  ModelChanges changes;
  changes.scale = 10;
  changes.rotate_degrees = {0, 0, 90};
  // Around the first one, in the coordinates of the data.
  changes.crop = Bounds{{-2015, 9995, -5}, {-2005, 10005, 25}};
  const Conversion done =
      convert_model(scratch / "a.ply", scratch / "b.ply", changes, {}, std::nullopt, false);
  CHECK(done.written == 1);
  const std::array<double, 3> origin = io::model_origin(scratch / "b.ply");
  CHECK(origin[0] == doctest::Approx(-2000));
  CHECK(origin[1] == doctest::Approx(10000));
  const Gaussians moved = read_model(scratch / "b.ply");
  CHECK(moved.means[0] == doctest::Approx(-10));
  CHECK(moved.means[2] == doctest::Approx(20));
}

TEST_CASE("a translation that leads an origin back to 0 takes it away") {
  const Scratch scratch;
  Gaussians model = trained_like(2, 0);
  model.means = {0, 1, 2, 3, 4, 5};
  write_model(scratch / "a.ply", model, {}, std::nullopt, {448262, 5411932, 300});
  const auto moved = [&](const glm::dvec3& by) {
    ModelChanges changes;
    changes.translate = by;
    convert_model(scratch / "a.ply", scratch / "b.ply", changes, {}, std::nullopt, true);
    return read_model(scratch / "b.ply").means;
  };
  CHECK(farthest(moved({-448260, -5411932, -300}), {2, 1, 2, 5, 4, 5}) == 0.0);
  CHECK(io::model_origin(scratch / "b.ply") == std::array<double, 3>{});
  // Any other moves it, and leaves the numbers alone.
  CHECK(moved({10, 0, 0}) == model.means);
  CHECK(io::model_origin(scratch / "b.ply") == std::array<double, 3>{448272, 5411932, 300});
  // As far away on the other side as numbers would merge.
  CHECK(moved({-400000, -5411932, -300}) == model.means);
  CHECK(io::model_origin(scratch / "b.ply") == std::array<double, 3>{48262, 0, 0});
}

TEST_CASE("a model moved to the coordinates of a map and back is where it was") {
  const Scratch scratch;
  const Gaussians model = trained_like(300, 1);
  write_model(scratch / "a.ply", model);
  const auto moved = [&](const char* from, const char* to, const glm::dvec3& by) {
    ModelChanges changes;
    changes.translate = by;
    return convert_model(scratch / from, scratch / to, changes, {}, std::nullopt, true).losses;
  };
  const glm::dvec3 place(500000, 4000000, 100);
  CHECK(moved("a.ply", "far.ply", place) ==
        "nothing is lost, positions count from 500000, 4000000, 100, as its header says, which "
        "other programs pass over");
  CHECK(moved("far.ply", "back.ply", -place) == "nothing is lost");
  CHECK(farthest(read_model(scratch / "back.ply").means, model.means) < 1e-5);
  CHECK(io::model_origin(scratch / "back.ply") == std::array<double, 3>{});
  // Numbers that are as far away themselves are moved as any.
  CHECK(moved("a.ply", "near.ply", {100, 0, 0}) == "nothing is lost");
  CHECK(io::model_origin(scratch / "near.ply") == std::array<double, 3>{});
  // Little blur is taken before an origin, and told.
  CHECK(moved("a.ply", "near.ply", {40000, 0, 0}) ==
        "32-bit numbers shift positions by 0.0024 that far away");
  CHECK(io::model_origin(scratch / "near.ply") == std::array<double, 3>{});
  CHECK(std::abs(read_model(scratch / "near.ply").means[0] - model.means[0] - 40000) < 0.01);
  CHECK(contains(message_of<UsageError>([&] {
                   moved("a.ply", "far.ply", {1e12, 0, 0});
                 }),
                 "would count from 1e+12, 0, 0"));
  Gaussians blurred = model;
  for (std::size_t i = 0; i < blurred.means.size(); i += 3) blurred.means[i] += 500000.0f;
  write_model(scratch / "blurred.ply", blurred);
  CHECK(moved("blurred.ply", "b.ply", {-500000, 0, 0}) == "nothing is lost");
  CHECK(read_model(scratch / "b.ply").means[0] == blurred.means[0] - 500000.0f);
  CHECK(moved("blurred.ply", "b.ply", {100, 0, 0}) == "nothing is lost");
  CHECK(read_model(scratch / "b.ply").means[0] == blurred.means[0] + 100.0f);
  // Formats without an origin: the loss is told.
  const std::string told = moved("a.ply", "far.glb", place);
  CHECK(told.starts_with("32-bit numbers shift positions by 0.24 that far away"));
  CHECK(contains(moved("a.ply", "far.spz", place), ", 32-bit numbers shift positions by 0.24"));
  for (const char* name : {"far.glb", "far.spz"}) {
    const Gaussians far = read_model(scratch / name);
    for (std::size_t i = 0; i < far.means.size(); ++i)
      CHECK(std::abs(far.means[i] - model.means[i] - place[static_cast<int>(i % 3)]) < 1.0);
  }
  CHECK(contains(moved("far.ply", "far.glb", {1, 0, 0}),
                 "no number of the Gaussians is changed, positions count from -500001, -4000000, "
                 "100, which is not said in the file"));
  CHECK(read_model(scratch / "far.glb").means == model.means);
}

TEST_CASE("conversion says the origin in the axes of the file that it writes") {
  const Scratch scratch;
  write_model(scratch / "a.ply", trained_like(3, 0), {}, std::nullopt, {448262, 0, 300});
  const auto told = [&](const char* to, SpzAxes axes) {
    ModelEncoding encoding;
    encoding.spz_axes = axes;
    return convert_model(scratch / "a.ply", scratch / to, {}, encoding, std::nullopt, true).losses;
  };
  CHECK(contains(told("b.glb", SpzAxes::kPly), "count from -448262, 0, 300, which is not said"));
  CHECK(contains(told("b.spz", SpzAxes::kPly), "count from 448262, 0, 300, which is not said"));
  CHECK(contains(told("b.spz", SpzAxes::kRub), "count from 448262, 0, -300, which is not said"));
}

TEST_CASE("opacities at the ends of a byte are whole ones in every format") {
  const Scratch scratch;
  Gaussians model = trained_like(300, 0);
  for (std::size_t i = 0; i < model.size(); ++i) model.opacities[i] = i % 2 == 0 ? 25.0f : -25.0f;
  for (const char* name : {"a.splat", "a.spz", "a.sog", "a.compressed.ply"}) {
    CAPTURE(name);
    write_model(scratch / name, model);
    std::size_t opaque = 0, empty = 0;
    for (const float logit : read_model(scratch / name).opacities) {
      opaque += io::opacity_of(logit) > 1 - 1e-6;
      empty += io::opacity_of(logit) < 1e-6;
      CHECK(std::isfinite(logit));
    }
    CHECK(opaque == 150);
    CHECK(empty == 150);
  }
}

TEST_CASE("rotations are kept as exactly as is said") {
  const Scratch scratch;
  const Gaussians model = in_morton_order(trained_like(2000, 0));
  const auto median_angle = [&](const char* name) {
    write_model(scratch / name, model);
    const std::vector<float> read = read_model(scratch / name).quaternions;
    REQUIRE(read.size() == model.quaternions.size());
    std::vector<double> angles;
    for (std::size_t i = 0; i < read.size(); i += 4) {
      double plus = 0, minus = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        const double a = read[i + k], b = model.quaternions[i + k];
        plus += (a + b) * (a + b);
        minus += (a - b) * (a - b);
      }
      angles.push_back(2 * std::sqrt(std::min(plus, minus)));
    }
    std::nth_element(angles.begin(), angles.begin() + 1000, angles.end());
    return angles[1000];
  };
  for (const auto& [name, format, step] :
       {std::tuple("a.spz", io::ModelFormat::kSpz, 670),
        std::tuple("a.compressed.ply", io::ModelFormat::kCompressedPly, 670),
        std::tuple("a.sog", io::ModelFormat::kSog, 170)}) {
    const std::string file = name;
    CAPTURE(file);
    CHECK(median_angle(name) == doctest::Approx(1.0 / step).epsilon(0.06));
    CHECK(contains(io::losses(format, model), "rotations to 1/" + std::to_string(step)));
  }
}

TEST_CASE("losses are named for the model at hand") {
  const Gaussians flat = trained_like(2, 0);
  CHECK(contains(io::losses(io::ModelFormat::kSplat, trained_like(2, 2)), "SH"));
  CHECK(!contains(io::losses(io::ModelFormat::kSplat, flat), "SH"));
  CHECK(io::losses(io::ModelFormat::kGltf, trained_like(2, 3)) == "nothing is lost");
  CHECK(contains(io::losses(io::ModelFormat::kGltf, trained_like(2, 4)), "degree 3"));
  const auto of_glb = [](float log_scale, float logit) {
    const Scratch scratch;
    Gaussians model = trained_like(2, 0);
    model.log_scales[1] = log_scale;
    model.opacities[1] = logit;
    write_model(scratch / "a.glb", model);
    const Gaussians again = read_model(scratch / "a.glb");
    const std::string told = io::losses(io::ModelFormat::kGltf, model);
    CHECK(contains(told, "scales beyond 1e-30 to 2.4e17 (1 of 2 Gaussians) are clamped") ==
          (std::abs(again.log_scales[1] - log_scale) > 1e-3f));
    CHECK(contains(told, "opacities within 1e-7 of 0 or 1 (1 of 2 Gaussians) are clamped") ==
          (std::abs(again.opacities[1] - logit) > 0.2f));
    CHECK((told == "nothing is lost") == !contains(told, "clamped"));
    return told;
  };
  CHECK(of_glb(-69, 16) == "nothing is lost");
  CHECK(of_glb(40, -16) == "nothing is lost");
  CHECK(contains(of_glb(-70, 17), "opacities within"));
  CHECK(contains(of_glb(41, -17), "scales beyond"));
  Gaussians needles = flat;
  needles.log_scales[0] = -14;
  CHECK(contains(io::losses(io::ModelFormat::kSpz, needles), "clamped"));
  CHECK(!contains(io::losses(io::ModelFormat::kSpz, flat), "clamped"));
  CHECK(contains(io::losses(io::ModelFormat::kSpz, flat), "1/4096"));
  CHECK(contains(io::losses(io::ModelFormat::kSog, flat), "of the range of their logarithm"));
  // 24 bits hold 100000 with 6 of them behind the point.
  Gaussians far = flat;
  far.means[4] = -100000.5f;
  CHECK(contains(io::losses(io::ModelFormat::kSpz, far), "1/64,"));
  Gaussians bright = trained_like(2, 1);
  CHECK(!contains(io::losses(io::ModelFormat::kSpz, bright), "clamped"));
  bright.sh[12] = -3.4f;
  CHECK(contains(io::losses(io::ModelFormat::kSpz, bright), "3.33 in SH (1 of 2 Gaussians)"));
  bright.sh[4] = bright.sh[17] = 1.5f;
  CHECK(contains(io::losses(io::ModelFormat::kSpz, bright), "+-1 (2 of 2 Gaussians)"));
}
