// SPDX-License-Identifier: Apache-2.0
#include "bench/report.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "raysplats/error.hpp"
#include "unit/bench/report_fixture.hpp"
#include "unit/temporary_directory.hpp"

using namespace raysplats;

TEST_CASE("report: shares of the limits") {
  const BenchReport report = sample_report();
  const BenchShare forward = share_of(report.rows[0], report.ceilings);
  CHECK(forward.copy == doctest::Approx(0.1));  // 1e9 / 0.5 / 2e10
  CHECK(forward.fma == doctest::Approx(0.2));   // 1e11 / 0.5 / 1e12
  CHECK(forward.bound == "fma");
  const BenchShare densify = share_of(report.rows[1], report.ceilings);
  CHECK(densify.copy == doctest::Approx(0.2));
  CHECK(densify.fma == 0);
  CHECK(densify.bound == "copy");
  CHECK(share_of(BenchRow{}, report.ceilings).bound.empty());
  CHECK(share_of(report.rows[0], Ceilings{}).bound.empty());
}

TEST_CASE("report: JSON reads back as it was") {
  const TemporaryDirectory folder;
  const BenchReport report = sample_report();
  folder.write("a.json", bench_json(report));
  const BenchReport back = read_bench_report(folder.path() / "a.json");
  CHECK(back.version == report.version);
  CHECK(back.date == report.date);
  CHECK(back.device == report.device);
  CHECK(back.driver == report.driver);
  CHECK(back.platform == report.platform);
  CHECK(back.compute_units == report.compute_units);
  CHECK(back.options == report.options);
  CHECK(back.ceilings.copy_bytes_per_second == report.ceilings.copy_bytes_per_second);
  CHECK(back.ceilings.fma_flops_per_second == report.ceilings.fma_flops_per_second);
  CHECK(back.peak_process_bytes == report.peak_process_bytes);
  CHECK(back.peak_device_bytes == report.peak_device_bytes);
  REQUIRE(back.rows.size() == 2);
  CHECK(back.rows[0].id() == "forward/random/1000");
  CHECK(back.rows[0].clock == "device");
  CHECK(back.rows[0].seconds.median == report.rows[0].seconds.median);
  CHECK(back.rows[0].seconds.deviation == report.rows[0].seconds.deviation);
  CHECK(back.rows[0].seconds.minimum == report.rows[0].seconds.minimum);
  CHECK(back.rows[0].seconds.maximum == report.rows[0].seconds.maximum);
  CHECK(back.rows[0].seconds.samples == 5);
  CHECK_FALSE(back.rows[0].wall);
  CHECK(back.rows[1].wall == 0.002);
  REQUIRE(back.rows[0].work.items.size() == 2);
  CHECK(back.rows[0].work.items[1].unit == "hits");
  CHECK(back.rows[0].work.items[1].count == 4e7);
  CHECK(back.rows[0].work.bytes == 1e9);
  CHECK(back.rows[0].work.flops == 1e11);
  CHECK(bench_json(back) == bench_json(report));
}

TEST_CASE("report: files that are none are refused in one sentence") {
  const TemporaryDirectory folder;
  const nlohmann::json good = nlohmann::json::parse(bench_json(sample_report()));
  const auto refuse = [&](const std::string& text, const std::string& part) {
    folder.write("bad.json", text);
    try {
      read_bench_report(folder.path() / "bad.json");
      FAIL("accepted");
    } catch (const DataError& error) {
      const std::string message = error.what();
      INFO(message);
      CHECK(message.find("bad.json") != std::string::npos);
      CHECK(message.find(part) != std::string::npos);
      CHECK(message.find('\n') == std::string::npos);
    }
  };
  refuse("", "bad.json");
  refuse("[]", "bad.json");
  refuse("{}", "no result of 'raysplats bench'");
  refuse("{\"schema\": 3}", "no result of 'raysplats bench'");
  nlohmann::json other = good;
  other["schema_version"] = 99;
  refuse(other.dump(), "version 99");
  other = good;
  other.erase("schema_version");
  refuse(other.dump(), "version null");
  other = good;
  other["rows"][0]["seconds"].erase("median");
  refuse(other.dump(), "damaged");
  other = good;
  other["rows"][0]["size"] = "many";
  refuse(other.dump(), "damaged");
  for (const double number : {5e220, -1.0, 0.5, 4294967296.0}) {
    other = good;
    other["compute_units"] = number;
    refuse(other.dump(), "no whole number");
  }
  CHECK_THROWS_AS(read_bench_report(folder.path() / "none.json"), DataError);
}

TEST_CASE("report: the table is aligned and the CSV complete") {
  const std::string table = bench_table(sample_report());
  CHECK(table.find("20.0 GB/s") != std::string::npos);
  CHECK(table.find("1000.0 GFLOP/s") != std::string::npos);
  CHECK(table.find("2 Mrays/s") != std::string::npos);
  CHECK(table.find("80 Mhits/s") != std::string::npos);
  CHECK(table.find("500 kGaussians/s") != std::string::npos);
  std::istringstream lines(table);
  std::vector<std::size_t> widths;
  for (std::string line; std::getline(lines, line);) {
    if (line.find("/random/") != std::string::npos || line.starts_with("row ")) {
      widths.push_back(line.size());
    }
  }
  REQUIRE(widths.size() == 3);
  CHECK(widths[0] == widths[1]);
  CHECK(widths[0] == widths[2]);

  BenchReport report = sample_report();
  report.rows[0].scene = "a \"b\", c";
  std::istringstream csv(bench_csv(report));
  std::string header, first, second, rest;
  std::getline(csv, header);
  std::getline(csv, first);
  std::getline(csv, second);
  CHECK_FALSE(std::getline(csv, rest));
  CHECK(header.starts_with("row,scene,size,clock,median_s,"));
  CHECK(first.starts_with("forward,\"a \"\"b\"\", c\",1000,device,0.5,0.01,0.4,0.6,5,,rays,"));
  CHECK(second.starts_with("densify,\"random\",1000,wall,0.002,0,0.002,0.002,5,0.002,Gaussians,"));
  const auto commas = [](const std::string& text) {
    return std::count(text.begin(), text.end(), ',');
  };
  CHECK(commas(header) == commas(second));
}
