// SPDX-License-Identifier: Apache-2.0
// Models as programs other than 3DGS and its viewers write them.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <cstdint>
#include <sstream>
#include <string>

#include "unit/io/model_bytes.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

/// Reads a PLY of one vertex; a name may have its type before it ("uchar:red").
Gaussians read_one(const std::string& properties, const std::string& row) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex 1\n";
  std::istringstream names{properties};
  for (std::string name; names >> name;) {
    const std::size_t colon = name.find(':');
    text += colon == std::string::npos
                ? fmt::format("property float {}\n", name)
                : fmt::format("property {} {}\n", name.substr(0, colon), name.substr(colon + 1));
  }
  const Scratch scratch;
  write_bytes(scratch / "a.ply", text + "end_header\n" + row + "\n");
  return read_model(scratch / "a.ply");
}

}  // namespace

TEST_CASE("a PLY of 2D Gaussian Splatting has flat Gaussians, which is told") {
  const LogCapture log;
  const Gaussians model =
      read_one("x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 rot_0 rot_1 rot_2 rot_3",
               "1 2 3 0.1 0.2 0.3 0.5 -3 -4 1 0 0 0");
  CHECK(model.log_scales == std::vector<float>{-3, -4, -20});
  CHECK(model.means == std::vector<float>{1, 2, 3});
  CHECK(model.opacities.front() == 0.5f);
  CHECK(log.lines() == 1);
  CHECK(log.contains("has no scale_2"));
  CHECK(contains(data_error([] {
                   read_one("x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 rot_0 rot_1 rot_2 rot_3",
                            "1 2 3 0.1 0.2 0.3 0.5 -3 1 0 0 0");
                 }),
                 "no scale_1, scale_2"));
}

TEST_CASE("a PLY of splatfacto may have bytes of colour in place of harmonics, which is told") {
  const std::string rest = " opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
  const std::string row = "0 0 0 255 0 51 1 -3 -3 -3 1 0 0 0";
  const LogCapture log;
  const Gaussians model = read_one("x y z uchar:red uchar:green uchar:blue" + rest, row);
  CHECK(model.sh_degree == 0);
  const double constant = 0.28209479177387814;
  CHECK(model.sh[0] == doctest::Approx(0.5 / constant));
  CHECK(model.sh[1] == doctest::Approx(-0.5 / constant));
  CHECK(model.sh[2] == doctest::Approx(-0.3 / constant));
  CHECK(log.contains("red, green and blue in place of harmonics"));
  // Harmonics count where there are some; floats may mean anything.
  CHECK(read_one("uchar:red uchar:green uchar:blue x y z f_dc_0 f_dc_1 f_dc_2" + rest,
                 "1 2 3 0 0 0 7 8 9 1 -3 -3 -3 1 0 0 0")
            .sh == std::vector<float>{7, 8, 9});
  CHECK(contains(data_error([&] { read_one("x y z red green blue" + rest, row); }),
                 "no f_dc_0, f_dc_1, f_dc_2"));
}

TEST_CASE("a .splat may begin with the two bytes of gzip") {
  std::string bytes;
  put<std::uint32_t>(bytes, 0x3f808b1fu);  // 1.0042...
  for (const float value : {2.0f, 3.0f, 1.0f, 1.0f, 1.0f}) put(bytes, value);
  bytes += bytes_of({255, 128, 0, 230, 255, 128, 128, 128});
  REQUIRE(bytes.starts_with("\x1f\x8b"));
  const Scratch scratch;
  write_bytes(scratch / "a.splat", bytes);
  const Gaussians model = read_model(scratch / "a.splat");
  REQUIRE(model.size() == 1);
  CHECK(model.means[0] == doctest::Approx(1.0042).epsilon(1e-4));
  CHECK(model.means[2] == 3.0f);
}
