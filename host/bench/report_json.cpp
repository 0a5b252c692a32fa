// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "bench/report.hpp"
#include "io/json_file.hpp"
#include "raysplats/error.hpp"
#include "util/json_text.hpp"

namespace raysplats {
namespace {

constexpr const char* kSchema = "raysplats-bench";
constexpr int kSchemaVersion = 1;

nlohmann::ordered_json row_json(const BenchRow& row, const Ceilings& ceilings) {
  nlohmann::ordered_json items = nlohmann::ordered_json::array();
  for (const BenchWork::Items& item : row.work.items) {
    items.push_back({{"unit", item.unit},
                     {"count", item.count},
                     {"per_second", row.seconds.median > 0 ? item.count / row.seconds.median : 0}});
  }
  const BenchShare share = share_of(row, ceilings);
  nlohmann::ordered_json out = {{"name", row.name},
                                {"scene", row.scene},
                                {"size", row.size},
                                {"clock", row.clock},
                                {"seconds",
                                 {{"samples", row.seconds.samples},
                                  {"median", row.seconds.median},
                                  {"deviation", row.seconds.deviation},
                                  {"minimum", row.seconds.minimum},
                                  {"maximum", row.seconds.maximum}}}};
  if (row.wall) out["wall_seconds"] = *row.wall;
  out["items"] = items;
  out["bytes"] = row.work.bytes;
  out["flops"] = row.work.flops;
  out["copy_share"] = share.copy;
  out["fma_share"] = share.fma;
  out["bound"] = share.bound;
  return out;
}

// Conversions of numbers out of range would wrap or be undefined.
template <class Whole>
Whole whole_number(const nlohmann::json& json, const char* key) {
  const nlohmann::json& value = json.at(key);
  if (!value.is_number_unsigned() ||
      value.get<std::uint64_t>() > std::numeric_limits<Whole>::max()) {
    throw std::out_of_range(fmt::format("'{}' is no whole number in its range", key));
  }
  return value.get<Whole>();
}

DataError damaged(const std::filesystem::path& path, const std::exception& error) {
  return DataError(fmt::format("{} is a damaged result of 'raysplats bench' ({}): run it again",
                               path.string(), error.what()));
}

BenchRow row_from(const nlohmann::json& json) {
  BenchRow row;
  row.name = json.at("name").get<std::string>();
  row.scene = json.at("scene").get<std::string>();
  row.size = whole_number<std::size_t>(json, "size");
  row.clock = json.at("clock").get<std::string>();
  const nlohmann::json& seconds = json.at("seconds");
  row.seconds.samples = whole_number<std::size_t>(seconds, "samples");
  row.seconds.median = seconds.at("median").get<double>();
  row.seconds.deviation = seconds.at("deviation").get<double>();
  row.seconds.minimum = seconds.at("minimum").get<double>();
  row.seconds.maximum = seconds.at("maximum").get<double>();
  if (json.contains("wall_seconds")) row.wall = json["wall_seconds"].get<double>();
  for (const nlohmann::json& item : json.at("items")) {
    row.work.items.push_back({item.at("unit").get<std::string>(), item.at("count").get<double>()});
  }
  row.work.bytes = json.at("bytes").get<double>();
  row.work.flops = json.at("flops").get<double>();
  return row;
}

}  // namespace

std::string bench_json(const BenchReport& report) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const BenchRow& row : report.rows) rows.push_back(row_json(row, report.ceilings));
  const nlohmann::ordered_json out = {
      {"schema", kSchema},
      {"schema_version", kSchemaVersion},
      {"raysplats", report.version},
      {"date", report.date},
      {"device", report.device},
      {"driver", report.driver},
      {"platform", report.platform},
      {"compute_units", report.compute_units},
      {"options", report.options},
      {"ceilings",
       {{"copy_bytes_per_second", report.ceilings.copy_bytes_per_second},
        {"fma_flops_per_second", report.ceilings.fma_flops_per_second}}},
      {"peak_process_bytes", report.peak_process_bytes},
      {"peak_device_bytes", report.peak_device_bytes},
      {"rows", rows}};
  // Drivers' names and a model's file name may be any bytes.
  return json_text(out, 2) + "\n";
}

BenchReport read_bench_report(const std::filesystem::path& path) {
  const nlohmann::json json = io::read_json_object(path);
  if (!json.contains("schema") || json["schema"] != kSchema) {
    throw DataError(fmt::format(
        "{} is no result of 'raysplats bench': give a file written by its --json", path.string()));
  }
  if (!json.contains("schema_version") || json["schema_version"] != kSchemaVersion) {
    throw DataError(fmt::format(
        "{} has version {} of the benchmark format and {} is understood: run the "
        "benchmark again with this program",
        path.string(), json.value("schema_version", nlohmann::json()).dump(), kSchemaVersion));
  }
  try {
    BenchReport report;
    report.version = json.at("raysplats").get<std::string>();
    report.date = json.at("date").get<std::string>();
    report.device = json.at("device").get<std::string>();
    report.driver = json.at("driver").get<std::string>();
    report.platform = json.at("platform").get<std::string>();
    report.compute_units = whole_number<std::uint32_t>(json, "compute_units");
    report.options = json.at("options").get<std::map<std::string, std::string>>();
    const nlohmann::json& ceilings = json.at("ceilings");
    report.ceilings.copy_bytes_per_second = ceilings.at("copy_bytes_per_second").get<double>();
    report.ceilings.fma_flops_per_second = ceilings.at("fma_flops_per_second").get<double>();
    report.peak_process_bytes = whole_number<std::uint64_t>(json, "peak_process_bytes");
    report.peak_device_bytes = whole_number<std::uint64_t>(json, "peak_device_bytes");
    for (const nlohmann::json& row : json.at("rows")) report.rows.push_back(row_from(row));
    return report;
  } catch (const nlohmann::json::exception& error) {
    throw damaged(path, error);
  } catch (const std::out_of_range& error) {
    throw damaged(path, error);
  }
}

}  // namespace raysplats
