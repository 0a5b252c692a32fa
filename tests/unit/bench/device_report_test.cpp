// SPDX-License-Identifier: Apache-2.0
#include "bench/device_report.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "bench/cards.hpp"
#include "bench/kernel_folders.hpp"
#include "bench/scene_bench.hpp"
#include "build_paths.hpp"
#include "device/fault_injection.hpp"
#include "raysplats/error.hpp"
#include "synth/bench_scenes.hpp"
#include "unit/bench/report_fixture.hpp"
#include "unit/fixture.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using test::contains;

TEST_CASE("a device's report holds its self-test, every size that fits the time, and its speeds") {
  Context context(test_device(), timed_options());
  BenchOptions options = tiny_bench(1);
  options.filter = "^(adam|view)/";
  const DeviceReport report = make_device_report(context, options);
  CHECK(report.checks.size() == 14);
  for (const SelfTestCheck& check : report.checks) {
    CAPTURE(check.name);
    CHECK(check.error > 0);
    CHECK(check.passed());
  }
  CHECK(report.passed());
  REQUIRE(report.runs.size() == 2);
  CHECK(report.runs[1].options.at("resolution") == "1600x1064");
  REQUIRE(report.frames.size() == 2);
  CHECK(report.frames[0].per_second > report.frames[1].per_second);
  REQUIRE(report.iterations.size() == 1);
  CHECK(report.left_out.empty());
  const nlohmann::json json = nlohmann::json::parse(device_report_json(report));
  CHECK(json.at("schema") == "raysplats-device-report");
  CHECK(json.at("self_test_passed") == true);
  CHECK(json.at("device").at("name") == context.device().name);
  CHECK(json.at("runs").at(1).at("rows").size() == report.runs[1].rows.size());
  REQUIRE(report.models.size() == 1);
  BenchOptions counted = options;
  counted.width = report.models[0].width;
  counted.height = report.models[0].height;
  const BenchModel model{"random",
                         bench_scene("random", options.sizes[0], options.seed, options.sh_degree),
                         bench_camera(counted.width, counted.height), true};
  CHECK(report.models[0].cards.iterations ==
        forecast_cards(SceneBench(context, model, counted).counts(true)).iterations);
  CHECK(json.at("models").at(0).at("rows").at("forward").size() == cards().size());
  CHECK(device_report_text(report).find("measured here: adam") != std::string::npos);
  CHECK(device_report_text(report).find("self-test passed") != std::string::npos);

  options.sizes = {options.sizes[0], 1'000'000'000};  // nothing is made of what cannot end in time
  const DeviceReport short_of_time = make_device_report(context, options, 300.0);
  CHECK(short_of_time.left_out.size() == 2);
  CHECK(short_of_time.runs.size() == 2);
  CHECK(make_device_report(context, options, 0.0).runs.empty());

  options.sizes = {options.sizes[0]};
  options.deadline = std::chrono::steady_clock::now();
  const BenchReport late = run_bench(context, options);
  CHECK(late.rows.empty());
  CHECK(late.left_out.size() == 2);

  DeviceReport wrong = report;
  wrong.checks[3].error = std::numeric_limits<double>::quiet_NaN();
  CHECK(!wrong.passed());
  CHECK(device_report_text(wrong).find("FAILED") != std::string::npos);
}

TEST_CASE("a device's report is made where the self-test fails, of whatever bytes") {
  Context context(test_device(), timed_options());
  BenchOptions options = tiny_bench(1);
  options.filter = "^(sort|adam)/";
  context.faults().arm(Fault::kLaunch, 1);
  DeviceReport report = make_device_report(context, options, 0.0);
  CHECK(!report.passed());
  REQUIRE(report.checks.size() == 8);
  CHECK(report.checks[0].failure.find("Launching kernel") != std::string::npos);
  CHECK(!report.checks[0].passed());
  CHECK(report.checks[1].name.starts_with("tree"));
  CHECK(report.checks[7].passed());
  CHECK(report.failed == 0);
  CHECK(device_report_text(report).find("FAILED: Launching kernel") != std::string::npos);
  report.left_out = {"what a driver says: \xff"};
  report.failed = 1;
  const nlohmann::json json = nlohmann::json::parse(device_report_json(report));
  CHECK(json.at("device").at("name") == context.device().name);
  CHECK(json.at("self_test").at(0).at("failure") == report.checks[0].failure);
  CHECK(json.at("failed") == 1);
  CHECK(json.at("left_out").at(0).get<std::string>().starts_with("what a driver says: "));
}

TEST_CASE("rows that yield more than two folders of kernels are compared by are named") {
  const std::string kernels = (std::filesystem::path(test::source_dir()) / "cl").string();
  BenchOptions options = tiny_bench(1);
  options.filter = "^(adam|densify|loss-gradient|loss-value|rays|view)/";
  options.repeat = 1;
  const KernelComparison same =
      compare_kernels(test_device(), timed_options(), kernels, kernels, options);
  CHECK(same.uncompared == std::vector<std::string>{"loss-value", "densify", "rays"});
  CHECK(contains(kernel_comparison_table(same),
                 "what these rows yield besides is not compared, but by the tests: loss-value, "
                 "densify, rays\n"));
}

TEST_CASE("what is no number in a result of two folders of kernels stays the largest difference") {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> before{1, 2, 4}, after{1, kNone, 5};
  const ResultDifference difference = difference_of("image", before, after);
  CHECK(difference.differing == 2);
  CHECK(std::isnan(difference.largest));
  const std::vector<float> others{1, 2.5f, 5};
  CHECK(difference_of("image", before, others).largest == 0.25);
}

TEST_CASE("two folders of kernels are compared by what they compute, then by time in turns") {
  const TemporaryDirectory folder;
  const std::filesystem::path own = std::filesystem::path(test::source_dir()) / "cl";
  const std::filesystem::path changed = folder.path() / "cl";
  std::filesystem::copy(own, changed, std::filesystem::copy_options::recursive);
  BenchOptions options = tiny_bench(1);
  options.filter = "^adam/";
  options.repeat = 3;
  const DeviceInfo device = test_device();
  const KernelComparison same =
      compare_kernels(device, timed_options(), own.string(), changed.string(), options);
  CHECK(same.equal());
  REQUIRE(same.rows.rows.size() == 1);
  CHECK(same.rows.rows[0].before > 0);
  CHECK(same.rows.rows[0].spread > 0);
  CHECK(same.uncompared.empty());
  const std::string table = kernel_comparison_table(same);
  CHECK(contains(table, fmt::format("the {} pictures, gradients and parameters after a step are "
                                    "equal to the last bit\n",
                                    same.results.size())));
  CHECK(!contains(table, "not compared"));

  // A step of Adam that goes further.
  const std::filesystem::path adam = changed / "train" / "adam.cl";
  std::stringstream text;
  text << std::ifstream(adam).rdbuf();
  std::string source = text.str();
  const std::string root = "* adam->root_scale";
  REQUIRE(source.find(root) != std::string::npos);
  source.replace(source.find(root), root.size(), "* 0.5f * adam->root_scale");
  std::ofstream(adam) << source;
  const KernelComparison other =
      compare_kernels(device, timed_options(), own.string(), changed.string(), options);
  CHECK(!other.equal());
  for (const ResultDifference& result : other.results) {
    CAPTURE(result.name);
    const bool stepped = result.name.find("after a step") != std::string::npos;
    CHECK((result.differing > 0) == stepped);
  }
  CHECK_THROWS_AS(compare_kernels(device, timed_options(), own.string(),
                                  (folder.path() / "none").string(), options),
                  DeviceError);
}
