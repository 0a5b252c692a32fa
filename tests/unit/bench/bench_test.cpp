// SPDX-License-Identifier: Apache-2.0
#include "bench/bench.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <set>

#include "bench/bench_cases.hpp"
#include "bench/ceilings.hpp"
#include "bench/operation.hpp"
#include "device/fault_injection.hpp"
#include "raysplats/error.hpp"
#include "synth/bench_scenes.hpp"
#include "unit/bench/report_fixture.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;

namespace {

void check_row(const BenchRow& row, const Ceilings& ceilings) {
  INFO(row.id());
  CHECK(row.seconds.samples == 2);
  CHECK(row.seconds.minimum > 0);
  CHECK(row.seconds.median > 0);
  CHECK(row.seconds.median <= row.seconds.maximum);
  if (row.wall) CHECK(*row.wall >= 0.5 * row.seconds.median);
  REQUIRE(!row.work.items.empty());
  for (const BenchWork::Items& items : row.work.items) {
    CHECK(items.count > 0);
    CHECK(!items.unit.empty());
  }
  CHECK(row.work.bytes > 0);
  const BenchShare share = share_of(row, ceilings);
  CHECK(std::isfinite(share.copy));
  CHECK(std::isfinite(share.fma));
  CHECK(share.copy > 0);
  CHECK(!share.bound.empty());
}

}  // namespace

TEST_CASE("bench: ids follow scenes, sizes and the filter") {
  BenchOptions options = tiny_bench(2);
  options.scenes = {"random", "surface"};
  options.sizes = {10, 20};
  const std::vector<std::string> all = bench_ids(options);
  CHECK(all.size() == 4 * bench_rows().size());
  CHECK(all.front() == "sort/random/10");
  CHECK(std::set<std::string>(all.begin(), all.end()).size() == all.size());
  options.filter = "^(refit|adam)/.*/20$";
  CHECK(bench_ids(options) == std::vector<std::string>{"refit/random/20", "adam/random/20",
                                                       "refit/surface/20", "adam/surface/20"});
  options.filter = std::string("(");
  CHECK_THROWS_AS(bench_ids(options), UsageError);
}

TEST_CASE("bench: every row has a time, work and a share of the limits") {
  Context context(test_device(), timed_options());
  const BenchOptions options = tiny_bench(2);
  const BenchReport report = run_bench(context, options);
  CHECK(report.device == context.device().name);
  CHECK(report.ceilings.copy_bytes_per_second > 1e8);
  CHECK(report.ceilings.fma_flops_per_second > 1e8);
  CHECK(report.peak_process_bytes > 0);
  CHECK(report.peak_device_bytes > 0);
  std::set<std::string> ids;
  for (const BenchRow& row : report.rows) {
    ids.insert(row.id());
    check_row(row, report.ceilings);
    for (const BenchRowInfo& info : bench_rows()) {
      if (info.name == row.name) CHECK(info.unit == row.work.items.front().unit);
    }
  }
  const std::vector<std::string> wanted = bench_ids(options);
  // Shapes of packets that the device does not have are named with the reason.
  for (const BenchReport::LeftOut& row : report.left_out) {
    INFO(row.id << ": " << row.reason);
    CHECK(row.id.find("group/") != std::string::npos);
    CHECK(row.reason.find("subgroup") != std::string::npos);
    CHECK(ids.insert(row.id).second);
  }
  CHECK(ids == std::set<std::string>(wanted.begin(), wanted.end()));
  CHECK(report.rows.size() + report.left_out.size() == wanted.size());
}

TEST_CASE("bench: a model and a filter") {
  Context context(test_device(), timed_options());
  BenchOptions options = tiny_bench(2);
  options.filter = "forward/|rays/";
  BenchModel model{"my model", bench_scene("surface", 500, 3, 1), bench_camera(32, 48)};
  model.camera.name = "my view";
  const BenchReport report = run_bench(context, options, &model);
  REQUIRE(report.rows.size() == 2);
  CHECK(report.rows[0].id() == "forward/my model/500");
  CHECK(report.rows[0].work.items.front().count == 32 * 48);
  CHECK(report.rows[1].id() == "rays/my model/500");
  CHECK(report.rows[1].work.items.front().count == 256);
  CHECK(report.options.at("resolution") == "32x48");
  CHECK(report.options.at("sh-degree") == "1");
  CHECK(report.options.at("view") == "my view");
  // Two models are told apart by any of their numbers.
  const std::string before = report.options.at("model");
  CHECK(bench_header(context, options, &model).options.at("model") == before);
  model.gaussians.sh.back() += 0.01f;
  CHECK(bench_header(context, options, &model).options.at("model") != before);
  options.filter = "nothing";
  CHECK_THROWS_AS(run_bench(context, options, &model), UsageError);
}

TEST_CASE("operations: launches go to their stages and failures come out") {
  Context context(test_device(), timed_options());
  Buffer<std::uint32_t> layout(context, 256, "layout");
  Kernel kernel = context.kernel("parallel/layout_probe.cl", "layout_probe");
  int prepared = 0, reset = 0, run = 0;
  const BenchOperation operation{[&] { ++prepared; },
                                 [&] { ++reset; },
                                 [&] {
                                   ++run;
                                   kernel.launch(Range{}, layout);
                                   layout.clear();
                                 },
                                 {{"all", {}, false, {}},
                                  {"probe", {"parallel/layout_probe.cl:lay"}, false, {}},
                                  {"fill", {":(fill)"}, false, {}},
                                  {"none", {"parallel/scan.cl"}, false, {}},
                                  {"host", {}, true, {}}}};
  const auto samples = run_operations(context, {operation}, 3, 1e-4);
  REQUIRE(samples.size() == 1);
  REQUIRE(samples[0].size() == 5);
  CHECK(prepared == 1);
  CHECK(run == reset);
  CHECK(run >= 4);
  for (std::size_t i = 0; i < 3; ++i) {
    REQUIRE(samples[0][0].seconds.size() == 3);
    const double all = samples[0][0].seconds[i];
    CHECK(all > 0);
    CHECK(samples[0][1].seconds[i] + samples[0][2].seconds[i] == doctest::Approx(all));
    CHECK(samples[0][3].seconds[i] == 0);
    CHECK(samples[0][4].seconds[i] == doctest::Approx(samples[0][0].wall[i]));
  }
  const BenchOperation broken{{}, {}, [] { throw DataError("broken on purpose"); }, {}};
  CHECK_THROWS_WITH_AS(run_operations(context, {broken, operation}, 2, 1e-4), "broken on purpose",
                       DataError);
  CHECK(run_operations(context, {operation}, 1, 1e-4).size() == 1);
}

TEST_CASE("operations: failures of device and memory are kept where that is asked for") {
  Context context(test_device(), timed_options());
  const BenchOperation good{{}, {}, [] {}, {{"good", {}, true, {}}}};
  const BenchOperation refused{
      [] { throw DeviceError("refused"); }, {}, [] {}, {{"refused", {}, true, {}}}, true};
  int run = 0;
  const BenchOperation late{{},
                            {},
                            [&] {
                              if (++run > 2) throw ResourceError("memory is at its end");
                            },
                            {{"late", {}, true, {}}, {"too", {}, true, {}}}};
  const auto keep = [&](const std::vector<BenchOperation>& operations) {
    return run_operations(context, operations, 3, 1e-9, {}, true);
  };
  const auto samples = keep({good, refused, late, good});
  CHECK(samples[0][0].seconds.size() == 3);
  CHECK(samples[0][0].failure.reason.empty());
  CHECK(samples[1][0].lacking == "refused");
  CHECK(samples[1][0].failure.reason.empty());
  for (const StageSamples& stage : samples[2]) {
    CHECK(stage.failure.reason == "memory is at its end");
    CHECK(stage.failure.of_memory);
  }
  CHECK(samples[3][0].failure.reason.empty());
  CHECK(samples[3][0].seconds.empty());
  const BenchOperation wrong{
      {}, {}, [] { throw UsageError("of another kind"); }, {{"wrong", {}, true, {}}}};
  CHECK_THROWS_WITH_AS(keep({wrong}), "of another kind", UsageError);
}

TEST_CASE("bench: the other rows are measured where one fails") {
  Context context(test_device(), timed_options());
  BenchOptions options = tiny_bench(1);
  options.filter = "^(sort|bounds|adam)/";
  options.keep_failures = true;
  measure_fma_rate(context);  // its programs are there: the next one is that of the first row
  context.faults().arm(Fault::kBuild, 1);
  const BenchReport report = run_bench(context, options);
  REQUIRE(report.left_out.size() == 1);
  CHECK(report.left_out[0].id == "sort/random/1000");
  CHECK(report.left_out[0].failed);
  CHECK_FALSE(report.left_out[0].reason.empty());
  REQUIRE(report.rows.size() == 2);
  CHECK(report.rows[0].name == "bounds");
  CHECK(report.rows[1].name == "adam");

  // What had no room beside the rows before it is measured without them.
  context.faults().arm(Fault::kAllocation, 22);
  const BenchReport again = run_bench(context, options);
  CHECK(again.left_out.empty());
  CHECK(again.rows.size() == 3);

  context.faults().arm(Fault::kLaunch, 1);
  const BenchReport unlimited = run_bench(context, options);
  REQUIRE(unlimited.left_out.size() == 1);
  CHECK(unlimited.left_out[0].id == "the device's limits");
  CHECK(unlimited.rows.size() == 3);
  options.keep_failures = false;
  context.faults().arm(Fault::kLaunch, 1);
  CHECK_THROWS_AS(run_bench(context, options), DeviceError);
}
