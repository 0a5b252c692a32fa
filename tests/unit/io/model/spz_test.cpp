// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "io/compression.hpp"
#include "io/model/spz_codes.hpp"
#include "scene/gaussians/gaussian_transform.hpp"
#include "unit/io/model_bytes.hpp"
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

std::string version3(int flags = 0) {
  return head(3, 1, 1, 12, flags) + kPosition + kAlpha + kColor + kScale + rotation() + kHarmonics;
}

/// Niantic's record of an extension.
std::string record(std::uint32_t type, const std::string& content) {
  std::string out;
  put(out, type);
  put(out, static_cast<std::uint32_t>(content.size()));
  return out + content;
}

/// That of the axes, of which PLY's are 6.
std::string axes_record(int axes) { return record(0xADBE0003u, bytes_of({axes, 0, 0, 0})); }

std::string version4(const std::string& records = axes_record(6), int flags = 2) {
  std::string out = "NGSP";
  put(out, std::uint32_t{4});
  put(out, std::uint32_t{1});
  out += bytes_of({1, 12, flags, 6});
  put(out, static_cast<std::uint32_t>(32 + records.size()));
  out.resize(32);
  out += records;
  std::string frames;
  for (const std::string& array : {kPosition, kAlpha, kColor, kScale, rotation(), kHarmonics}) {
    const std::string frame = text_of(io::zstd(as_span(array)));
    put(out, std::uint64_t{frame.size()});
    put(out, std::uint64_t{array.size()});
    frames += frame;
  }
  return out + frames;
}

Gaussians read(const std::string& bytes, SpzAxes assumed = SpzAxes::kPly) {
  const Scratch scratch;
  write_bytes(scratch / "a.spz", bytes);
  return read_model(scratch / "a.spz", {assumed});
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
  check_known(read(version4("", 0)));
  const Scratch scratch;
  const Gaussians model = read(gzipped(version3()));
  write_model(scratch / "three.spz", model, {SpzAxes::kPly, 3});
  CHECK(gunzipped(read_bytes(scratch / "three.spz"), version3().size()) == version3());
  write_model(scratch / "four.spz", model, {SpzAxes::kPly, 4});
  CHECK(read_bytes(scratch / "four.spz") == version4());
}

TEST_CASE("SPZ: a gzip stream may have several members, and other bytes behind them") {
  const std::string raw = version3();
  for (const std::size_t cut : {std::size_t{5}, std::size_t{16}, std::size_t{30}, raw.size()}) {
    CAPTURE(cut);
    const std::string members = gzipped(raw.substr(0, cut)) + gzipped(raw.substr(cut));
    check_known(read(members));
    check_known(read(gzipped("") + members + std::string(8, '\0')));
    CHECK(contains(error_of(members + gzipped("x")), "holds more"));
    CHECK(contains(error_of(members + gzipped(std::string(1 << 20, 'x'))), "holds more"));
    CHECK(contains(error_of(members + bytes_of({0x1f, 0x8b})), "truncated"));
    CHECK(contains(error_of(members + bytes_of({0x1f, 0x8b, 0, 0})), "damaged"));
  }
  CHECK(contains(error_of(gzipped(raw.substr(0, 20)) + gzipped(raw.substr(20, 4))), "holds less"));
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
  const LogCapture log;
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

TEST_CASE("SPZ: a sky of Gaussians that are too large is told") {
  const Scratch scratch;
  Gaussians model = trained_like(200, 0);
  const auto told = [&](double sky, const std::string& what) {
    for (std::size_t i = 0; i < 15; ++i) model.log_scales[i] = static_cast<float>(std::log(sky));
    const LogCapture log;
    write_model(scratch / "a.spz", model);
    return log.contains(what);
  };
  CHECK(!told(370.0, "warning"));
  CHECK(told(2000.0, "5 of 200 Gaussians are larger"));
  CHECK(told(2000.0, "convert --scale 0.1"));
  // What is told helps.
  for (float& s : model.log_scales) s += static_cast<float>(std::log(0.1));
  CHECK(!told(200.0, "warning"));
}

TEST_CASE("SPZ: all of a model that lies far away is told to be moved") {
  const Scratch scratch;
  Gaussians model = trained_like(50, 0);
  for (std::size_t i = 0; i < model.means.size(); i += 3) model.means[i] += 5e6f;
  const LogCapture log;
  write_model(scratch / "a.spz", model);
  CHECK(log.contains("convert --translate"));
  CHECK(!log.contains("--crop"));
}

TEST_CASE("SPZ: right, up, back axes are half a turn about x, harmonics included") {
  const Scratch scratch;
  const Gaussians model = trained_like(20, 3);
  write_model(scratch / "rub.spz", model, {SpzAxes::kRub, 3});
  const Gaussians raw = read_model(scratch / "rub.spz");
  const Gaussians back = read_model(scratch / "rub.spz", {SpzAxes::kRub});
  CHECK(std::abs(raw.means[1] + model.means[1]) < 1e-3);
  CHECK(farthest(back.means, model.means) <= 0.5 / 4096 + 1e-6);
  CHECK(farthest(back.sh, model.sh) <= 1.0 / 64 + 1e-6);
  // Degree 1 is y, z, x: the first two change sign.
  CHECK(std::abs(raw.sh[3] + model.sh[3]) < 0.05);
  CHECK(std::abs(raw.sh[9] - model.sh[9]) < 0.05);
}

TEST_CASE("SPZ: axes that a file declares are obeyed, whatever is assumed") {
  const Scratch scratch;
  const Gaussians model = trained_like(20, 4);
  const auto check_same = [&](const Gaussians& found) {
    CHECK(farthest(found.means, model.means) <= 0.5 / 4096 + 1e-6);
    CHECK(farthest(found.sh, model.sh) <= 1.0 / 32);
    CHECK(farthest(found.log_scales, model.log_scales) <= 1.0 / 32 + 1e-6);
  };
  for (const SpzAxes written : {SpzAxes::kPly, SpzAxes::kRub}) {
    write_model(scratch / "a.spz", model, {written, 4});
    CHECK(read_bytes(scratch / "a.spz").substr(32, 12) ==
          axes_record(written == SpzAxes::kRub ? 4 : 6));
    check_same(read_model(scratch / "a.spz"));
    check_same(read_model(scratch / "a.spz", {SpzAxes::kRub}));
  }
  // x, y and z of every number, in the order of spz's CoordinateSystem.
  const char* const systems[] = {"LDB", "RDB", "LUB", "RUB", "LDF", "RDF", "LUF", "RUF",
                                 "LFD", "RFD", "LFU", "RFU", "LBD", "RBD", "LBU", "RBU"};
  for (int n = 1; n <= 16; ++n) {
    CAPTURE(n);
    // What a PLY's right, down and front are on these axes.
    glm::dmat4 turn(0.0);
    turn[3][3] = 1.0;
    for (int axis = 0; axis < 3; ++axis) {
      const char letter = systems[n - 1][axis];
      if (letter == 'R' || letter == 'L') turn[0][axis] = letter == 'R' ? 1.0 : -1.0;
      if (letter == 'D' || letter == 'U') turn[1][axis] = letter == 'D' ? 1.0 : -1.0;
      if (letter == 'F' || letter == 'B') turn[2][axis] = letter == 'F' ? 1.0 : -1.0;
    }
    write_model(scratch / "a.spz", transformed(model, turn), {SpzAxes::kPly, 4});
    std::string bytes = read_bytes(scratch / "a.spz");
    bytes[40] = static_cast<char>(n);
    check_same(read(bytes));
  }
  // By hand: x right, y front, z up, and a mirrored one.
  CHECK(read(version4(axes_record(12))).means == std::vector<float>{1, -1.0f / 4096, -1});
  CHECK(read(version4(axes_record(5))).means == std::vector<float>{-1, -1, 1.0f / 4096});
}

TEST_CASE("SPZ: axes are declared among other records, and which are taken is told") {
  const std::vector<float> as_in_file{1, -1, 1.0f / 4096}, turned{1, 1, -1.0f / 4096};
  const auto told = [](const std::string& bytes, SpzAxes assumed, const std::string& part) {
    const LogCapture log;
    const Gaussians model = read(bytes, assumed);
    CHECK(log.lines() == (part.empty() ? 0u : 1u));
    CHECK(log.contains(part));
    return model.means;
  };
  const std::string other = record(0xADBE0002u, std::string(12, 'x'));
  const std::string rub = "x right, y up, z back, as it declares";
  CHECK(told(version4(other + axes_record(4)), SpzAxes::kPly, rub) == turned);
  CHECK(told(version4(axes_record(4) + axes_record(6)), SpzAxes::kPly, rub) == turned);
  const std::string legacy = gzipped(version3(2) + other + axes_record(4));
  CHECK(told(legacy, SpzAxes::kPly, rub) == turned);
  CHECK(told(version4(), SpzAxes::kPly, "") == as_in_file);
  CHECK(told(version4(), SpzAxes::kRub, "x right, y down, z front") == as_in_file);
  // Nothing is said, or nothing that is meant.
  const std::string open = "does not declare its axes";
  CHECK(told(gzipped(version3()), SpzAxes::kPly, open) == as_in_file);
  CHECK(told(gzipped(version3()), SpzAxes::kRub, "") == turned);
  CHECK(told(version4(axes_record(0)), SpzAxes::kPly, open) == as_in_file);
  CHECK(told(version4(axes_record(0)), SpzAxes::kRub, "") == turned);
  CHECK(told(version4(axes_record(4), 0), SpzAxes::kPly, open) == as_in_file);
  CHECK(told(version4(axes_record(4).substr(0, 11)), SpzAxes::kPly, open) == as_in_file);
  CHECK(contains(error_of(version4(axes_record(17))), "declares its axes by 17"));
  CHECK(contains(error_of(version4(record(0xADBE0003u, "abc"))), "by 3 bytes"));
}

TEST_CASE("SPZ: equal Gaussians, which pack best, are read again, and none have no streams") {
  const Scratch scratch;
  for (const std::size_t count : {200000u, 300000u}) {
    Gaussians model;
    model.resize(count);
    for (const int version : {3, 4}) {
      write_model(scratch / "a.spz", model, {SpzAxes::kPly, version});
      CHECK(read_model(scratch / "a.spz").size() == count);
    }
  }
  std::string none = head(4, 0, 3, 12);
  put(none, std::uint32_t{32});
  none.resize(32);
  CHECK(read(none).size() == 0);
  // As other programs wrote it, with frames of nothing.
  std::string frames = none;
  frames[12] = 0;
  frames[15] = 5;
  const std::string frame = text_of(io::zstd({}));
  for (int i = 0; i < 5; ++i) {
    put(frames, std::uint64_t{frame.size()});
    put(frames, std::uint64_t{0});
  }
  for (int i = 0; i < 5; ++i) frames += frame;
  CHECK(read(frames).size() == 0);
}

TEST_CASE("SPZ: damage ends in one sentence, before memory is asked for") {
  CHECK(check_damage(gzipped(version3()), "a.spz") > 100);
  CHECK(check_damage(version4(), "a.spz") > 100);
  CHECK(contains(error_of(version3()), "gzip"));
  CHECK(contains(error_of(gzipped(head(3, 4000000000u, 4, 12))), "more than"));
  // Nor can as many as any file may hold, and some more.
  CHECK(contains(error_of(gzipped(head(3, 300000, 4, 12))), "more than"));
  CHECK(contains(error_of(gzipped(head(3, 3000, 4, 12))), "holds less"));
  std::string four = version4();
  four[10] = 50;
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
  lying.replace(52, 8, std::string("\0\0\0\x40\0\0\0\0", 8));
  CHECK(contains(error_of(lying), "where 9 are needed"));
  CHECK(contains(error_of(bytes_of({0x1f, 0x8b})), "truncated"));
}
