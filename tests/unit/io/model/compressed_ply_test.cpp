// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include "scene/morton_order.hpp"
#include "unit/io/model_bytes.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

const std::vector<std::string> kRanges{"x",       "y", "z", "scale_x", "scale_y",
                                       "scale_z", "r", "g", "b"};

/// `count` equal Gaussians in chunks whose ranges are 0..2, with `harmonics` SH values each.
std::string compressed(std::size_t count,
                       std::size_t harmonics,
                       std::size_t ranges = 9,
                       std::size_t chunks = SIZE_MAX) {
  if (chunks == SIZE_MAX) chunks = (count + 255) / 256;
  std::string out =
      "ply\nformat binary_little_endian 1.0\nelement chunk " + std::to_string(chunks) + "\n";
  for (const char* end : {"min_", "max_"}) {
    for (std::size_t k = 0; k < ranges; ++k) out += "property float " + (end + kRanges[k]) + "\n";
  }
  out += "element vertex " + std::to_string(count) + "\n";
  for (const char* name : {"position", "rotation", "scale", "color"})
    out += std::string("property uint packed_") + name + "\n";
  if (harmonics > 0) {
    out += "element sh " + std::to_string(count) + "\n";
    for (std::size_t k = 0; k < harmonics; ++k)
      out += "property uchar f_rest_" + std::to_string(k) + "\n";
  }
  out += "end_header\n";
  for (std::size_t i = 0; i < chunks; ++i) {
    for (std::size_t k = 0; k < ranges; ++k) put(out, 0.0f);
    for (std::size_t k = 0; k < ranges; ++k) put(out, 2.0f);
  }
  for (std::size_t i = 0; i < count; ++i) {
    put(out, (2047u << 21) | (0u << 11) | 2047u);              // (2, 0, 2)
    put(out, (2u << 30) | (0u << 20) | (1023u << 10) | 512u);  // y largest, w = -x
    put(out, (0u << 21) | (1023u << 11) | 0u);                 // (0, 2, 0)
    put(out, (255u << 24) | (0u << 16) | (51u << 8) | 204u);   // (2, 0, 0.4), opacity 0.8
  }
  for (std::size_t i = 0; i < count * harmonics; ++i)
    out.push_back(static_cast<char>(i % harmonics == 0 ? 0 : (i % harmonics == 1 ? 255 : 128)));
  return out;
}

Gaussians read(const std::string& bytes) {
  const Scratch scratch;
  write_bytes(scratch / "a.ply", bytes);
  return read_model(scratch / "a.ply");
}

std::string error_of(const std::string& bytes) {
  return data_error([&] { read(bytes); });
}

}  // namespace

TEST_CASE("compressed PLY: known words become positions, rotations, scales and colours") {
  const Gaussians model = read(compressed(2, 9));
  REQUIRE(model.size() == 2);
  CHECK(model.sh_degree == 1);
  CHECK(std::vector<float>(model.means.begin(), model.means.begin() + 3) ==
        std::vector<float>{2, 0, 2});
  CHECK(std::vector<float>(model.log_scales.begin(), model.log_scales.begin() + 3) ==
        std::vector<float>{0, 2, 0});
  const double w = -std::sqrt(0.5);
  CHECK(model.quaternions[0] == doctest::Approx(w));
  CHECK(model.quaternions[1] == doctest::Approx(-w));
  CHECK(std::abs(model.quaternions[2]) < 0.03);
  CHECK(std::abs(model.quaternions[3]) < 1e-3);
  CHECK(model.sh[0] == doctest::Approx(1.5 / 0.28209479177387814));
  CHECK(model.sh[1] == doctest::Approx(-0.5 / 0.28209479177387814));
  CHECK(model.sh[2] == doctest::Approx(-0.1 / 0.28209479177387814));
  CHECK(1 / (1 + std::exp(-model.opacities[0])) == doctest::Approx(0.8));
  // Three coefficients a colour: the file's first three are red.
  CHECK(model.sh[3] == -4.0f);
  CHECK(model.sh[6] == 4.0f);
  CHECK(model.sh[4] == doctest::Approx(8 * (128.5 / 256 - 0.5)));
}

TEST_CASE("compressed PLY: chunks, old colours and sizes around a chunk") {
  for (const std::size_t count : {0u, 1u, 255u, 256u, 257u})
    CHECK(read(compressed(count, 0)).size() == count);
  const Gaussians old = read(compressed(1, 0, 6));
  CHECK(old.sh[0] == doctest::Approx(0.5 / 0.28209479177387814));
  CHECK(read(compressed(3, 45)).sh_degree == 3);
  // As read_ply() too.
  const Scratch scratch;
  write_bytes(scratch / "a.ply", compressed(5, 24));
  CHECK(read_ply(scratch / "a.ply").sh_degree == 2);
}

TEST_CASE("compressed PLY: what is written is read again within the steps of the format") {
  const Scratch scratch;
  for (const std::size_t count : {0u, 1u, 255u, 256u, 257u, 1500u}) {
    for (const int degree : {0, 1, 2, 3, 4}) {
      CAPTURE(count);
      CAPTURE(degree);
      // Along the curve already, so that nothing changes places.
      const Gaussians model = in_morton_order(trained_like(count, degree));
      write_model(scratch / "a.compressed.ply", model);
      const Gaussians back = read_model(scratch / "a.compressed.ply");
      REQUIRE(back.size() == count);
      CHECK(back.sh_degree == std::min(degree, 3));
      // Half a step of the widest chunk: 11 bits of a range below 24, 10 bits of the middle axis.
      CHECK(farthest(back.means, model.means) <= 24.0 / 1023 / 2);
      CHECK(farthest(back.log_scales, model.log_scales) <= 10.0 / 1023 / 2);
      const auto stride = static_cast<std::size_t>(3 * sh_coefficients(model.sh_degree));
      const auto kept = static_cast<std::size_t>(3 * sh_coefficients(back.sh_degree));
      for (std::size_t i = 0; i < count; ++i) {
        double cosine = 0;
        for (std::size_t k = 0; k < 4; ++k)
          cosine += static_cast<double>(model.quaternions[4 * i + k] * back.quaternions[4 * i + k]);
        CHECK(std::abs(cosine) > 1 - 4e-6);
        const auto opacity = [](float logit) { return 1 / (1 + std::exp(-logit)); };
        CHECK(std::abs(opacity(model.opacities[i]) - opacity(back.opacities[i])) <= 0.0021f);
        for (std::size_t k = 0; k < kept; ++k) {
          const double step = k < 3 ? 2.0 / 255 / 2 / 0.28 : 8.0 / 256;
          CHECK(std::abs(model.sh[stride * i + k] - back.sh[kept * i + k]) <= step);
        }
      }
    }
  }
}

TEST_CASE("compressed PLY: equal Gaussians, ends of the ranges and sizes are exact") {
  const Scratch scratch;
  const Gaussians model = read(compressed(300, 9));
  write_model(scratch / "a.compressed.ply", model);
  const Gaussians back = read_model(scratch / "a.compressed.ply");
  CHECK(back.means == model.means);
  CHECK(back.log_scales == model.log_scales);
  // Those of the file do not leave out their largest number.
  double cosine = 0;
  for (std::size_t k = 0; k < 4; ++k)
    cosine += static_cast<double>(model.quaternions[k] * back.quaternions[k]);
  CHECK(std::abs(cosine) > 1 - 4e-6);
  CHECK(back.opacities == model.opacities);
  CHECK(back.sh == model.sh);
  // 16 bytes each, 9 of SH, 72 for each of two chunks.
  const std::string bytes = read_bytes(scratch / "a.compressed.ply");
  CHECK(bytes.size() - bytes.find("end_header\n") - 11 == 300 * (16 + 9) + 2 * 72);
  Gaussians huge = trained_like(2, 0);
  huge.log_scales[0] = 90;
  write_model(scratch / "b.compressed.ply", huge);
  const Gaussians cut = read_model(scratch / "b.compressed.ply");
  CHECK(std::max(cut.log_scales[0], cut.log_scales[3]) == 20.0f);
}

TEST_CASE("compressed PLY: damage ends in one sentence") {
  CHECK(check_damage(compressed(1, 9), "a.ply") > 100);
  CHECK(contains(error_of(compressed(257, 0, 9, 1)), "257 Gaussians have 1 chunks"));
  CHECK(contains(error_of(compressed(1, 10)), "10 properties"));
  CHECK(contains(error_of(compressed(1, 0, 5)), "min_scale_z"));
}

TEST_CASE("a model with a number that is not finite is written in no format") {
  const Scratch scratch;
  Gaussians model;
  model.resize(2);
  std::fill(model.quaternions.begin(), model.quaternions.end(), 0.5f);
  for (const char* name : {"m.ply", "m.compressed.ply", "m.splat", "m.spz", "m.sog", "m.glb"}) {
    CAPTURE(name);
    Gaussians bad = model;
    bad.means[4] = std::numeric_limits<float>::quiet_NaN();
    const std::string told = data_error([&] { write_model(scratch / name, bad); });
    CHECK(contains(told, "Gaussian 1 has a number of 'means' that is not finite"));
    CHECK(!fs::exists(scratch / name));
    write_model(scratch / name, model);
    CHECK(read_model(scratch / name).size() == 2);
  }
}
