// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "program.hpp"
#include "raysplats/io.hpp"

using namespace raysplats;

TEST_CASE("rays of a file are traced into a file") {
  const TemporaryFolder folder;
  // A white ball of opacity one half at the origin.
  Gaussians model;
  model.resize(1);
  model.log_scales.assign(3, std::log(0.2f));
  model.sh.assign(3, 1.7724539f);
  write_ply(folder / "model.ply", model);
  write_npy(folder / "rays.npy", "False", "(2, 6)", {0, 0, -3, 0, 0, 1, 5, 0, -3, 0, 0, 1});
  const std::vector<std::string> arguments{
      "trace", folder / "model.ply", "--rays",       folder / "rays.npy",
      "-o",    folder / "seen.npz",  "--background", "0,0,1",
      "-q"};
  const Outcome outcome = raysplats_program(arguments);
  CAPTURE(outcome.err);
  CHECK(outcome.code == 0);
  CHECK(outcome.out.find("2 rays") == 0);
  std::ifstream stream(folder / "seen.npz", std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(stream)), {});
  // The same rays, the first of their indices running fastest.
  write_npy(folder / "rays.npy", "True", "(2, 6)", {0, 5, 0, 0, -3, -3, 0, 0, 0, 0, 1, 1});
  std::filesystem::remove(folder / "seen.npz");
  CHECK(raysplats_program(arguments).code == 0);
  std::ifstream again(folder / "seen.npz", std::ios::binary);
  CHECK(bytes == std::string((std::istreambuf_iterator<char>(again)), {}));
  const std::size_t name = bytes.find("alpha.npy");
  const std::size_t end = bytes.find('\n', name);
  REQUIRE(end != std::string::npos);
  float alpha[2];
  std::memcpy(alpha, bytes.data() + end + 1, sizeof(alpha));
  CHECK(alpha[0] == doctest::Approx(0.5).epsilon(1e-4));
  CHECK(alpha[1] == 0.0f);

  // Rays are in the files' coordinates, from which the model's origin is taken off.
  write_ply(folder / "far.ply", model, std::nullopt, {1000, 2000, 3000});
  write_npy(folder / "rays.npy", "False", "(2, 6)",
            {1000, 2000, 2997, 0, 0, 1, 1005, 2000, 2997, 0, 0, 1});
  std::vector<std::string> of_survey = arguments;
  of_survey[1] = folder / "far.ply";
  std::filesystem::remove(folder / "seen.npz");
  CHECK(raysplats_program(of_survey).code == 0);
  std::ifstream moved(folder / "seen.npz", std::ios::binary);
  CHECK(bytes == std::string((std::istreambuf_iterator<char>(moved)), {}));

  // The mirrors of a run are about cameras, too.
  const std::string run = folder / "run";
  std::filesystem::create_directories(run + "/point_cloud/iteration_7");
  write_ply(run + "/point_cloud/iteration_7/point_cloud.ply", model);
  std::ofstream(run + "/config.toml") << "mirrors = [\"mirror.obj\"]\n";
  const Outcome of_run =
      raysplats_program({"trace", run, "--rays", folder / "rays.npy", "-o", folder / "run.npz"});
  CHECK(of_run.code == 0);
  CHECK(of_run.err.find("trained with mirrors, which rays of your own do not meet") !=
        std::string::npos);

  std::vector<std::string> one_array = arguments;
  one_array[5] = folder / "seen.npy";
  const Outcome of_one = raysplats_program(one_array);
  CHECK(of_one.code == 2);
  CHECK(one_sentence(of_one));
  CHECK(of_one.err.find("give a .npz") != std::string::npos);
  CHECK(!std::filesystem::exists(folder / "seen.npy"));

  // A camera could be near, a ray is where it says.
  std::vector<std::string> near = arguments;
  near.insert(near.end(), {"--near", "1", "--overwrite"});
  const Outcome of_cameras = raysplats_program(near);
  CHECK(of_cameras.code == 2);
  CHECK(one_sentence(of_cameras));
  CHECK(of_cameras.err.find("give --near 0") != std::string::npos);

  const auto refused = [&](const std::string& shape, std::size_t count) {
    write_npy(folder / "rays.npy", "False", shape, std::vector<float>(count));
    std::filesystem::remove(folder / "seen.npz");
    const Outcome bad = raysplats_program(arguments);
    CHECK(bad.code != 0);
    CHECK(!std::filesystem::exists(folder / "seen.npz"));
    CHECK(bad.err.find('\n') == bad.err.size() - 1);
    return bad.err;
  };
  CHECK(refused("(3, 4)", 12).find("(3, 4)") != std::string::npos);
  CHECK(refused("(2, 6)", 11).find("44 bytes") != std::string::npos);
  // Zeros are no directions.
  CHECK(refused("(2, 6)", 12).find("Ray 0") != std::string::npos);
}
