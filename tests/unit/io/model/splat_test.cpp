// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "unit/io/model_bytes.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

/// Two Gaussians: the larger one first, turned by half a turn about z, and an unturned one.
std::string two_splats() {
  std::string out;
  for (const float value : {1.0f, -2.5f, 0.25f, 1.0f, 1.0f, 1.0f}) put(out, value);
  out += bytes_of({255, 128, 0, 230, 128, 128, 128, 255});
  for (const float value : {0.0f, 4.0f, 8.0f, 1.0f, 1.0f, 1.0f}) put(out, value);
  out += bytes_of({1, 2, 3, 51, 255, 128, 128, 128});
  return out;
}

}  // namespace

TEST_CASE(".splat: bytes to Gaussians and back to the same bytes") {
  const Scratch scratch;
  write_bytes(scratch / "a.splat", two_splats());
  const Gaussians model = read_model(scratch / "a.splat");
  REQUIRE(model.size() == 2);
  CHECK(model.sh_degree == 0);
  CHECK(model.means == std::vector<float>{1, -2.5, 0.25, 0, 4, 8});
  CHECK(model.log_scales == std::vector<float>(6, 0.0f));
  CHECK(model.quaternions == std::vector<float>{0, 0, 0, 1, 1, 0, 0, 0});
  CHECK(model.sh[0] == doctest::Approx(0.5 / 0.28209479177387814));
  CHECK(model.sh[2] == doctest::Approx(-0.5 / 0.28209479177387814));
  CHECK(1.0 / (1.0 + std::exp(-model.opacities[1])) == doctest::Approx(0.2));
  write_model(scratch / "b.splat", model);
  CHECK(read_bytes(scratch / "b.splat") == two_splats());
}

TEST_CASE(".splat: written models keep what the format can say, most important first") {
  const Scratch scratch;
  for (const std::size_t count : {0u, 1u, 255u, 256u, 257u}) {
    const Gaussians model = trained_like(count, 2);
    write_model(scratch / "a.splat", model);
    CHECK(fs::file_size(scratch / "a.splat") == 32 * count);
    CHECK(read_model(scratch / "a.splat").size() == count);
  }
  Gaussians model = trained_like(2, 0);
  model.opacities = {-1.0f, 3.0f};
  model.log_scales = {-3, -3, -3, -3, -3, -3};
  write_model(scratch / "a.splat", model);
  const Gaussians again = read_model(scratch / "a.splat");
  CHECK(again.means[0] == model.means[3]);
  CHECK(farthest(again.log_scales, model.log_scales) < 1e-6);
  CHECK(std::abs(again.opacities[0] - 3.0f) < 0.05);
}

TEST_CASE(".splat: damage ends in one sentence") {
  CHECK(check_damage(two_splats(), "a.splat") > 0);
  const Scratch scratch;
  std::string bytes = two_splats();
  bytes.replace(0, 4, std::string("\0\0\xc0\x7f", 4));
  write_bytes(scratch / "nan.splat", bytes);
  CHECK(contains(data_error([&] { read_model(scratch / "nan.splat"); }), "not finite"));
  write_bytes(scratch / "cut.splat", two_splats().substr(0, 33));
  CHECK(contains(data_error([&] { read_model(scratch / "cut.splat"); }), "truncated"));
}
