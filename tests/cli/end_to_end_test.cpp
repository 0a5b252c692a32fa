// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "program.hpp"

namespace fs = std::filesystem;

namespace {

using Names = std::vector<std::string>;

// dB; what 1500 Gaussians inside the carved body start from, and what 150 iterations make of them
// at least.
constexpr double kUntrained = 17.5;
constexpr double kTrained = 18.0;

double psnr_of(const std::string& model, const std::string& data, const std::string& output) {
  succeed({"eval", model, "--data", data, "-o", output, "-q"});
  const nlohmann::json metrics =
      nlohmann::json::parse(read_file(fs::path(output) / "metrics.json"));
  CHECK(metrics.at("images").size() == 3);
  const double ssim = metrics.at("ssim").get<double>();
  CHECK(ssim > -1.0);
  CHECK(ssim < 1.0);
  return metrics.at("psnr").get<double>();
}

std::string model_of(const std::string& run, int iteration) {
  return (fs::path(run) / "point_cloud" / ("iteration_" + std::to_string(iteration)) /
          "point_cloud.ply")
      .string();
}

std::vector<std::string> file_names(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder))
    names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace

TEST_CASE("generate, train, evaluate, render, resume") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  const std::string run = folder / "run";
  succeed({"generate", data, "--size", "48", "--train-views", "12", "--test-views", "3"});
  const nlohmann::json info = nlohmann::json::parse(succeed({"info", data, "--json"}).out);
  CHECK(info.at("train_views") == 12);
  CHECK(info.at("test_views") == 3);

  const std::vector<std::string> recipe{"--init-count",
                                        "1500",
                                        "--densify-until",
                                        "0",
                                        "--position-lr",
                                        "0.002",
                                        "--checkpoint-every",
                                        "75",
                                        "-q"};
  const auto train = [&](const std::string& output, const std::string& iterations) {
    std::vector<std::string> arguments{"train", data, "-o", output, "-n", iterations};
    arguments.insert(arguments.end(), recipe.begin(), recipe.end());
    succeed(arguments);
  };
  train(folder / "untrained", "1");
  train(run, "150");
  const double before = psnr_of(folder / "untrained", data, folder / "eval_untrained");
  const double after = psnr_of(run, data, folder / "eval");
  MESSAGE("PSNR ", before, " dB untrained, ", after, " dB after 150 iterations");
  CHECK(before < kUntrained);
  CHECK(after > kTrained);

  // The trainer's own figure, the run and the file inside the run: one model traced with the same
  // settings.
  const nlohmann::json metrics = nlohmann::json::parse(read_file(fs::path(run) / "metrics.json"));
  CHECK(metrics.at("evaluations").back().at("psnr").get<double>() ==
        doctest::Approx(after).epsilon(1e-4));
  CHECK(psnr_of(model_of(run, 150), data, folder / "eval_file") == after);
  CHECK(metrics.at("command").get<std::string>().starts_with("raysplats train "));

  succeed({"render", run, "--data", data, "-o", folder / "png", "-q"});
  CHECK(file_names(folder / "png") == Names{"r_0.png", "r_1.png", "r_2.png"});
  succeed(
      {"render", run, "--data", data, "-o", folder / "exr", "--format", "exr", "--depth", "-q"});
  CHECK(file_names(folder / "exr") == Names{"r_0.exr", "r_1.exr", "r_2.exr"});
  succeed({"render", model_of(run, 150), "--orbit", "2", "--width", "32", "--height", "24",
           "--supersample", "2", "-o", folder / "orbit", "--format", "jpg", "--depth", "-q"});
  CHECK(file_names(folder / "orbit") ==
        Names{"frame_0000.jpg", "frame_0000_depth.png", "frame_0001.jpg", "frame_0001_depth.png"});
  const Outcome cameras =
      succeed({"render", run, "--cameras", data + "/transforms_test.json", "--downscale", "2", "-o",
               folder / "cameras", "--profile", "--max-hits", "1"});
  CHECK(file_names(folder / "cameras").size() == 3);
  CHECK(cameras.out.find("trace_forward") != std::string::npos);
  CHECK(cameras.err.find("stopped at --max-hits 1") != std::string::npos);

  // As after a crash: back to the checkpoint in the middle, under the names that other trainers
  // use.
  const std::string whole = read_file(model_of(run, 150));
  REQUIRE(fs::remove(fs::path(run) / "checkpoints" / "step_000000150.rsck"));
  REQUIRE(fs::remove(model_of(run, 150)));
  succeed(
      {"train", "--data_dir", data, "--result_dir", run, "--max_steps=150", "--resume", run, "-q"});
  CHECK(read_file(model_of(run, 150)) == whole);
  const nlohmann::json state = nlohmann::json::parse(succeed({"info", run, "--json"}).out);
  CHECK(state.at("type") == "run");
  CHECK(state.at("iteration") == 150);
  CHECK(state.at("gaussians") == 1500);
}

TEST_CASE("a run with mirrors is evaluated and rendered with them") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  const std::string run = folder / "run";
  succeed({"generate", data, "--size", "32", "--train-views", "6", "--test-views", "3"});
  write_file(folder / "mirror.obj",
             "v -4 -4 -1.2\nv 4 -4 -1.2\nv 4 4 -1.2\nv -4 4 -1.2\nf 1 2 3\nf 1 3 4\n");
  succeed({"train", data, "-o", run, "-n", "20", "--init-count", "500", "--mirror",
           folder / "mirror.obj", "-q"});
  const nlohmann::json metrics = nlohmann::json::parse(read_file(fs::path(run) / "metrics.json"));
  const double trained = metrics.at("evaluations").back().at("psnr").get<double>();
  CHECK(psnr_of(run, data, folder / "eval") == doctest::Approx(trained).epsilon(1e-4));
  // The same model out of its run has no mirrors.
  fs::copy_file(model_of(run, 20), folder / "model.ply");
  CHECK(std::abs(psnr_of(folder / "model.ply", data, folder / "eval_model") - trained) > 0.05);
  succeed({"render", run, "--data", data, "-o", folder / "with", "-q"});
  succeed({"render", folder / "model.ply", "--data", data, "-o", folder / "without", "-q"});
  CHECK(read_file(folder / "with/r_0.png") != read_file(folder / "without/r_0.png"));
  const Outcome depth =
      raysplats_program({"render", run, "--data", data, "-o", folder / "depth", "--depth", "-q"});
  CHECK(depth.code == 2);
  CHECK(one_sentence(depth));
}

TEST_CASE("a PLY that leaves its run shows what the run shows") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  const std::string run = folder / "run";
  succeed({"generate", data, "--size", "32", "--train-views", "6", "--test-views", "3"});
  succeed({"train", data, "-o", run, "-n", "20", "--init-count", "500", "--hit-order", "entry",
           "--quantile", "6", "--no-adaptive-radius", "--background", "0.2,0.4,0.9", "-q"});
  fs::copy_file(model_of(run, 20), folder / "model.ply");
  succeed({"render", run, "--data", data, "-o", folder / "run_frames", "-q"});
  succeed({"render", folder / "model.ply", "--data", data, "-o", folder / "ply_frames", "-q"});
  CHECK(read_file(folder / "run_frames/r_0.png") == read_file(folder / "ply_frames/r_0.png"));
  // A model of another program is shown as rasterisers show it, which is said.
  write_file(folder / "foreign.ply", ply_file(3));
  const Outcome foreign = succeed({"render", folder / "foreign.ply", "--orbit", "1", "--width",
                                   "16", "-o", folder / "foreign"});
  CHECK(foreign.err.find("peak order") != std::string::npos);
}

TEST_CASE("a report that cannot be written fails no run") {
  const TemporaryFolder folder;
  const std::string data = folder / "data", run = folder / "run";
  succeed({"generate", data, "--size", "24", "--train-views", "4", "--test-views", "1"});
  const std::vector<std::string> train{"train", data, "-o", run, "--init-count", "200"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), train.begin(), train.end());
    return more;
  };
  CHECK(succeed(with({"-n", "5"})).out.find("Report: ") != std::string::npos);
  const fs::path report = fs::path(run) / "report.html";
  fs::remove(report);
  write_file(report / "in_the_way", "");
  const Outcome outcome = succeed(with({"-n", "8", "--resume", "latest"}));
  CHECK(outcome.out.find("Report: ") == std::string::npos);
  CHECK(outcome.err.find("the run is whole, but has no report") != std::string::npos);
  CHECK(outcome.err.find("raysplats report " + run) != std::string::npos);
}
