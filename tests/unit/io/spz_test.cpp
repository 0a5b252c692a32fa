// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "io/compression.hpp"
#include "io/spz_codes.hpp"
#include "model_bytes.hpp"
#include "unit/log_capture.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

std::string text_of(const std::vector<std::byte>& bytes) {
  return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

std::string gzipped(const std::string& raw) {
  const std::vector<std::span<const std::byte>> parts{as_span(raw)};
  return text_of(io::gzip(parts));
}

/// What is in a gzip stream of this many bytes.
std::string gunzipped(const std::string& bytes, std::size_t size) {
  std::string raw(size, '\0');
  io::GzipReader reader(as_span(bytes), "test");
  reader.read(std::as_writable_bytes(std::span(raw.data(), raw.size())));
  reader.finish(0);
  return raw;
}

std::string head(std::uint32_t version, std::uint32_t points, int degree, int bits, int flags = 0) {
  std::string out = "NGSP";
  put(out, version);
  put(out, points);
  return out + bytes_of({degree, bits, flags, 0});
}

/// One Gaussian of degree 1 at (1, -1, 1/4096): the largest part of its rotation is y, and z = -w
/// of it is about 0.5.
const std::string kPosition = bytes_of({0x00, 0x10, 0x00, 0x00, 0xf0, 0xff, 0x01, 0x00, 0x00});
const std::string kAlpha = bytes_of({230});
const std::string kColor = bytes_of({255, 128, 0});
const std::string kScale = bytes_of({123, 0, 255});
const std::string kHarmonics = bytes_of({0, 8, 128, 248, 136, 120, 128, 128, 128});

/// y is the largest of x, y, z, w; then x = 0, z = 361 steps down, w = 361 steps up.
std::string rotation() {
  std::string out;
  put(out, (1u << 30) | (0u << 20) | ((512u + 361u) << 10) | 361u);
  return out;
}

std::string version3() {
  return head(3, 1, 1, 12) + kPosition + kAlpha + kColor + kScale + rotation() + kHarmonics;
}

std::string version4() {
  std::string out = "NGSP";
  put(out, std::uint32_t{4});
  put(out, std::uint32_t{1});
  out += bytes_of({1, 12, 0, 6});
  put(out, std::uint32_t{32});
  out.resize(32);
  std::string frames;
  for (const std::string& array : {kPosition, kAlpha, kColor, kScale, rotation(), kHarmonics}) {
    const std::string frame = text_of(io::zstd(as_span(array)));
    put(out, std::uint64_t{frame.size()});
    put(out, std::uint64_t{array.size()});
    frames += frame;
  }
  return out + frames;
}

Gaussians read(const std::string& bytes) {
  const Scratch scratch;
  write_bytes(scratch / "a.spz", bytes);
  return read_model(scratch / "a.spz");
}

std::string error_of(const std::string& bytes) {
  return data_error([&] { read(bytes); });
}

void check_known(const Gaussians& model) {
  REQUIRE(model.size() == 1);
  CHECK(model.sh_degree == 1);
  CHECK(model.means == std::vector<float>{1, -1, 1.0f / 4096});
  CHECK(model.log_scales == std::vector<float>{-2.3125, -10, 5.9375});
  CHECK(1 / (1 + std::exp(-model.opacities[0])) == doctest::Approx(230 / 255.0));
  CHECK(model.sh[0] == doctest::Approx(0.5 / 0.15));
  CHECK(model.sh[1] == doctest::Approx((128 / 255.0 - 0.5) / 0.15));
  CHECK(model.sh[2] == doctest::Approx(-0.5 / 0.15));
  CHECK(std::vector<float>(model.sh.begin() + 3, model.sh.end()) ==
        std::vector<float>{-1, -0.9375, 0, 0.9375, 0.0625, -0.0625, 0, 0, 0});
  const double half = 361 / 511.0 / std::sqrt(2.0);
  CHECK(model.quaternions[0] == doctest::Approx(half));
  CHECK(model.quaternions[1] == 0.0f);
  CHECK(model.quaternions[2] == doctest::Approx(std::sqrt(1 - 2 * half * half)));
  CHECK(model.quaternions[3] == doctest::Approx(-half));
}

}  // namespace

TEST_CASE("SPZ: known bytes of versions 3 and 4 are read, and written again") {
  check_known(read(gzipped(version3())));
  check_known(read(version4()));
  const Scratch scratch;
  const Gaussians model = read(gzipped(version3()));
  write_model(scratch / "three.spz", model, {SpzAxes::kPly, 3});
  CHECK(gunzipped(read_bytes(scratch / "three.spz"), version3().size()) == version3());
  write_model(scratch / "four.spz", model, {SpzAxes::kPly, 4});
  CHECK(read_bytes(scratch / "four.spz") == version4());
}

TEST_CASE("SPZ: versions 1 and 2 have half floats and three bytes of rotation") {
  const std::string rest = kAlpha + kColor + kScale;
  const Gaussians two =
      read(gzipped(head(2, 1, 0, 8) + kPosition + rest + bytes_of({255, 0, 128})));
  CHECK(two.means == std::vector<float>{16, -16, 1.0f / 256});
  CHECK(two.quaternions[1] == 1.0f);
  CHECK(two.quaternions[2] == -1.0f);
  CHECK(two.quaternions[0] == 0.0f);
  const Gaussians turned =
      read(gzipped(head(2, 1, 0, 8) + kPosition + rest + bytes_of({204, 128, 128})));
  CHECK(turned.quaternions[1] == doctest::Approx(0.6));
  CHECK(turned.quaternions[0] == doctest::Approx(0.8).epsilon(1e-3));
  // 1.5, -2, the smallest number of all.
  const std::string halves = bytes_of({0x00, 0x3e, 0x00, 0xc0, 0x01, 0x00});
  const Gaussians one = read(gzipped(head(1, 1, 0, 0) + halves + rest + bytes_of({128, 128, 128})));
  CHECK(one.means == std::vector<float>{1.5, -2, std::ldexp(1.0f, -24)});
  CHECK(contains(error_of(gzipped(head(1, 1, 0, 0) + bytes_of({0, 0x7c, 0, 0, 0, 0}) + rest +
                                  bytes_of({128, 128, 128}))),
                 "not finite"));
}

TEST_CASE("SPZ: round trips stay within the steps of the format at every degree and size") {
  const Scratch scratch;
  for (const int version : {3, 4}) {
    for (const std::size_t count : {0u, 1u, 255u, 256u, 257u}) {
      const int degree = static_cast<int>(count % 5);
      const Gaussians model = trained_like(count, degree);
      write_model(scratch / "a.spz", model, {SpzAxes::kPly, version});
      const Gaussians again = read_model(scratch / "a.spz");
      REQUIRE(again.size() == count);
      CHECK(again.sh_degree == degree);
      CHECK(farthest(again.means, model.means) <= 0.5 / 4096 + 1e-6);
      CHECK(farthest(again.log_scales, model.log_scales) <= 1.0 / 32 + 1e-6);
      CHECK(farthest(again.sh, model.sh) <= 1.0 / 64 + 1e-6);
      CHECK(farthest_rotation(again.quaternions, model.quaternions) < 1e-5);
    }
  }
}

TEST_CASE("SPZ: large scenes get coarser steps, and what fits no step is refused") {
  const Scratch scratch;
  Gaussians model = trained_like(2, 0);
  model.means[0] = 100000.5f;
  write_model(scratch / "a.spz", model);
  CHECK(std::abs(read_model(scratch / "a.spz").means[0] - 100000.5f) <= 0.5f / 64);
  model.means[0] = 1e7f;
  fs::remove(scratch / "a.spz");
  CHECK(
      contains(data_error([&] { write_model(scratch / "a.spz", model); }), "scale the model down"));
  CHECK(!fs::exists(scratch / "a.spz"));
}

TEST_CASE("SPZ: scenes in tiny units get finer steps, and what is too small is told") {
  const Scratch scratch;
  Gaussians model;
  model.resize(200);
  CounterRng rng(4, 4);
  const auto scaled = [&](double unit, double size) {
    for (float& x : model.means) x = static_cast<float>(unit * (2 * rng.uniform() - 1));
    for (float& s : model.log_scales) s = static_cast<float>(std::log(size));
    for (std::size_t i = 0; i < model.size(); ++i) model.quaternions[4 * i] = 1.0f;
    LogCapture log;
    write_model(scratch / "a.spz", model);
    const Gaussians read = read_model(scratch / "a.spz");
    double worst = 0;
    for (std::size_t i = 0; i < model.means.size(); ++i)
      worst = std::max(worst, std::abs(static_cast<double>(read.means[i] - model.means[i])));
    const std::string told = log.contains("convert --scale 100") ? "scale"
                             : log.contains("convert --crop")    ? "crop"
                             : log.contains("warning")           ? "other"
                                                                 : "";
    return std::pair(worst, told);
  };
  CHECK(io::spz_fractional_bits(model) == 12);
  auto [worst, told] = scaled(3.0, 0.01);
  CHECK(io::spz_fractional_bits(model) == 12);
  CHECK(told.empty());
  // Without finer steps every position would be one of a few dozen.
  std::tie(worst, told) = scaled(3e-3, 1e-4);
  CHECK(io::spz_fractional_bits(model) == 16);
  CHECK(worst <= 0.5 / 65536 * 1.001);
  CHECK(told.empty());
  std::tie(worst, told) = scaled(3e-4, 1e-5);
  CHECK(worst < 1.25e-6);
  CHECK(told == "scale");
  std::tie(worst, told) = scaled(2000.0, 1e-4);
  CHECK(io::spz_fractional_bits(model) == 12);
  CHECK(told == "crop");
}

TEST_CASE("SPZ: right, up, back axes are half a turn about x, harmonics included") {
  const Scratch scratch;
  const Gaussians model = trained_like(20, 3);
  write_model(scratch / "rub.spz", model, {SpzAxes::kRub, 4});
  const Gaussians raw = read_model(scratch / "rub.spz");
  const Gaussians back = read_model(scratch / "rub.spz", {SpzAxes::kRub, 4});
  CHECK(std::abs(raw.means[1] + model.means[1]) < 1e-3);
  CHECK(farthest(back.means, model.means) <= 0.5 / 4096 + 1e-6);
  CHECK(farthest(back.sh, model.sh) <= 1.0 / 64 + 1e-6);
  // Degree 1 is y, z, x: the first two change sign.
  CHECK(std::abs(raw.sh[3] + model.sh[3]) < 0.05);
  CHECK(std::abs(raw.sh[9] - model.sh[9]) < 0.05);
}

TEST_CASE("SPZ: damage ends in one sentence, before memory is asked for") {
  CHECK(check_damage(gzipped(version3()), "a.spz") > 100);
  CHECK(check_damage(version4(), "a.spz") > 100);
  CHECK(contains(error_of(version3()), "gzip"));
  CHECK(contains(error_of(gzipped(head(3, 4000000000u, 4, 12))), "more than"));
  // Three thousand positions could be in so many bytes, but not their harmonics.
  CHECK(contains(error_of(gzipped(head(3, 3000, 4, 12))), "more than"));
  std::string four = version4();
  four[8] = 100;
  four[9] = 50;
  four[12] = 4;
  CHECK(contains(error_of(four), "more than"));
  CHECK(contains(error_of(gzipped(head(5, 0, 0, 12))), "version is 5"));
  CHECK(contains(error_of(gzipped(head(3, 1, 9, 12))), "degree is 9"));
  CHECK(contains(error_of(gzipped(version3() + "x")), "holds more"));
  std::string with_extension = version3();
  with_extension[14] = 2;
  check_known(read(gzipped(with_extension + std::string(24, 'x'))));
  // A stream that claims a gigabyte where the header implies nine bytes.
  std::string lying = version4();
  lying.replace(40, 8, std::string("\0\0\0\x40\0\0\0\0", 8));
  CHECK(contains(error_of(lying), "where 9 are needed"));
  CHECK(contains(error_of(bytes_of({0x1f, 0x8b})), "truncated"));
}
