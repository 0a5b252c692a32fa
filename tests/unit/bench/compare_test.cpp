// SPDX-License-Identifier: Apache-2.0
#include "bench/compare.hpp"

#include <doctest/doctest.h>

#include "unit/bench/report_fixture.hpp"

using namespace raysplats;

TEST_CASE("compare: ratios, and which differences exceed the spread") {
  const BenchReport before = sample_report();
  BenchReport after = before;
  after.rows[0].seconds = {5, 0.25, 0.01, 0.2, 0.3};
  after.rows[1].seconds = {5, 0.00201, 0.0001, 0.0019, 0.0022};
  const BenchComparison comparison = compare_reports(before, after);
  REQUIRE(comparison.rows.size() == 2);
  CHECK(comparison.rows[0].id == "forward/random/1000");
  CHECK(comparison.rows[0].before == 0.5);
  CHECK(comparison.rows[0].after == 0.25);
  CHECK(comparison.rows[0].ratio == doctest::Approx(0.5));
  CHECK(comparison.rows[0].significant);
  CHECK(comparison.rows[1].ratio == doctest::Approx(1.005));
  CHECK_FALSE(comparison.rows[1].significant);
  CHECK(comparison.only_before.empty());
  CHECK(comparison.only_after.empty());
  CHECK(comparison.differing.empty());
  const std::string table = comparison_table(comparison);
  const auto marked = [&](const char* ratio) {
    const std::size_t at = table.find(ratio);
    REQUIRE(at != std::string::npos);
    return table.substr(at, table.find('\n', at) - at).ends_with(" *");
  };
  CHECK(marked("0.500"));
  CHECK_FALSE(marked("1.005"));
}

TEST_CASE("compare: few samples count by their ends") {
  const BenchReport before = sample_report();
  BenchReport after = before;
  after.rows[0].seconds = {3, 0.6, 0.0, 0.4, 0.7};  // deviation 0, but the ends lie 0.3 apart
  CHECK_FALSE(compare_reports(before, after).rows[0].significant);
  after.rows[0].seconds = {3, 0.6, 0.0, 0.59, 0.61};
  CHECK(compare_reports(before, after).rows[0].significant);
}

TEST_CASE("compare: rows of one file only and other circumstances are listed") {
  BenchReport before = sample_report();
  BenchReport after = sample_report();
  before.rows[1].name = "adam";
  after.device = "another";
  after.options["resolution"] = "16x12";
  const BenchComparison comparison = compare_reports(before, after);
  REQUIRE(comparison.rows.size() == 1);
  CHECK(comparison.only_before == std::vector<std::string>{"adam/random/1000"});
  CHECK(comparison.only_after == std::vector<std::string>{"densify/random/1000"});
  CHECK(comparison.differing.size() == 2);
  const std::string table = comparison_table(comparison);
  CHECK(table.find("only in A: adam/random/1000") != std::string::npos);
  CHECK(table.find("only in B: densify/random/1000") != std::string::npos);
  CHECK(table.find("--resolution: 8x6 -> 16x12") != std::string::npos);
}

TEST_CASE("compare: options that only one of the files has are listed") {
  const BenchReport before = sample_report();
  BenchReport after = before;
  after.options["near"] = "0.5";
  CHECK(compare_reports(before, after).differing ==
        std::vector<std::string>{"--near: not in the file -> 0.5"});
  CHECK(compare_reports(after, before).differing ==
        std::vector<std::string>{"--near: 0.5 -> not in the file"});
}
