// SPDX-License-Identifier: Apache-2.0
// What a run records of its course: metrics.csv and metrics.json of its folder.
#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "raysplats/error.hpp"
#include "run/run_folder.hpp"
#include "util/atomic_file.hpp"
#include "util/json_text.hpp"

namespace raysplats {
namespace {

constexpr char kCsvHeader[] = "iteration,seconds,loss,psnr,gaussians,it_per_s,candidates,hits\n";

std::ptrdiff_t columns(std::string_view row) { return std::count(row.begin(), row.end(), ','); }

/// A row of metrics.csv below `header` with all the columns of today: those that came later are 0.
/// Nothing for one that was cut off, as by a power failure.
std::string with_all_columns(const std::string& row, const std::string& header) {
  const bool known = std::string_view(kCsvHeader).starts_with(header);
  if (!known || columns(row) != columns(header) || row.ends_with(',')) return "";
  std::string out = row;
  for (std::ptrdiff_t i = columns(header); i < columns(kCsvHeader); ++i) out += ",0";
  return out + "\n";
}

// Iteration, seconds, loss and PSNR of a row of metrics.csv; what it lacks is 0.
TrainRow first_columns(const std::string& line) {
  TrainRow row;
  const char* end = line.data() + line.size();
  const char* next = std::from_chars(line.data(), end, row.iteration).ptr;
  for (double* column : {&row.seconds, &row.loss, &row.psnr}) {
    if (next == end || *next != ',') break;
    double value = 0;
    next = std::from_chars(next + 1, end, value).ptr;
    if (std::isfinite(value)) *column = value;
  }
  return row;
}

nlohmann::json to_json(const EvaluationRow& row) {
  nlohmann::json json{{"iteration", row.iteration},
                      {"training_seconds", row.training_seconds},
                      {"psnr", row.psnr},
                      {"ssim", row.ssim},
                      {"views", row.views},
                      {"gaussians", row.gaussians},
                      {"psnr_corrected", row.psnr_corrected}};
  if (row.psnr_all) json["psnr_all"] = *row.psnr_all;
  if (row.psnr_aligned) json["psnr_aligned"] = *row.psnr_aligned;
  return json;
}

EvaluationRow evaluation_from_json(const nlohmann::json& json) {
  EvaluationRow row;
  json.at("iteration").get_to(row.iteration);
  json.at("training_seconds").get_to(row.training_seconds);
  json.at("psnr").get_to(row.psnr);
  json.at("ssim").get_to(row.ssim);
  json.at("views").get_to(row.views);
  json.at("gaussians").get_to(row.gaussians);
  row.psnr_corrected = json.value("psnr_corrected", 0.0);  // runs of older versions have none
  if (json.contains("psnr_all")) row.psnr_all = json.at("psnr_all").get<double>();
  if (json.contains("psnr_aligned")) row.psnr_aligned = json.at("psnr_aligned").get<double>();
  return row;
}

}  // namespace

void RunFolder::begin_metrics(std::int64_t iteration) {
  evaluations_.clear();
  validations_.clear();
  rows_.clear();
  former_ = std::make_shared<const nlohmann::json>();
  std::string csv = kCsvHeader;
  if (iteration > 0) {
    std::ifstream rows(path_ / "metrics.csv");
    std::string header;
    std::getline(rows, header);
    std::string line;
    while (std::getline(rows, line)) {
      const TrainRow row = first_columns(line);
      if (row.iteration <= 0 || row.iteration > iteration) continue;
      const std::string whole = with_all_columns(line, header);
      if (whole.empty()) continue;
      csv += whole;
      rows_.push_back(row);
    }
    std::ifstream metrics(path_ / "metrics.json");
    try {
      former_ = std::make_shared<const nlohmann::json>(nlohmann::json::parse(metrics));
      const nlohmann::json& old = *former_;
      for (const nlohmann::json& entry : old.at("evaluations")) {
        const EvaluationRow row = evaluation_from_json(entry);
        if (row.iteration <= iteration) evaluations_.push_back(row);
      }
      for (const nlohmann::json& entry : old.value("validations", nlohmann::json::array())) {
        const EvaluationRow row = evaluation_from_json(entry);
        if (row.iteration <= iteration) validations_.push_back(row);
      }
    } catch (const nlohmann::json::exception&) {
      // Reports of an earlier run that cannot be read are no reason not to train.
    }
  }
  if (writes_) write_text_file(path_ / "metrics.csv", csv);
}

void RunFolder::append(const TrainRow& row) {
  if (!writes_) return;
  std::ofstream stream(path_ / "metrics.csv", std::ios::app);
  stream << fmt::format("{},{:.3f},{:.7g},{:.4f},{},{:.3f},{},{}\n", row.iteration, row.seconds,
                        row.loss, row.psnr, row.gaussians, row.iterations_per_second,
                        row.candidates, row.hits);
  stream.flush();
  if (!stream.good()) {
    throw DataError(fmt::format("{} cannot be written: {}", (path_ / "metrics.csv").string(),
                                std::strerror(errno)));
  }
}

void RunFolder::record(const EvaluationRow& row) {
  if (!evaluations_.empty() && evaluations_.back().iteration == row.iteration)
    evaluations_.pop_back();
  evaluations_.push_back(row);
}

void RunFolder::write_metrics(const nlohmann::json& summary) const {
  if (!writes_) return;
  nlohmann::json json = summary;
  json["evaluations"] = nlohmann::json::array();
  for (const EvaluationRow& row : evaluations_) json["evaluations"].push_back(to_json(row));
  if (!validations_.empty()) {
    json["validations"] = nlohmann::json::array();
    for (const EvaluationRow& row : validations_) json["validations"].push_back(to_json(row));
  }
  json["note"] = "training_seconds exclude evaluation and compiling kernels";
  write_text_file(path_ / "metrics.json", json_text(json, 2) + "\n");
}

double judged_psnr(const EvaluationRow& row, bool exposures) {
  return row.psnr_aligned.value_or(exposures ? row.psnr_corrected : row.psnr);
}

std::optional<EvaluationRow> better_before(std::span<const EvaluationRow> evaluations,
                                           bool exposures,
                                           double margin) {
  std::optional<EvaluationRow> best;
  for (const EvaluationRow& row : evaluations) {
    const EvaluationRow& last = evaluations.back();
    if (row.views != last.views || row.psnr_aligned.has_value() != last.psnr_aligned.has_value())
      continue;
    if (!best || judged_psnr(row, exposures) > judged_psnr(*best, exposures)) best = row;
  }
  if (best && judged_psnr(*best, exposures) <= judged_psnr(evaluations.back(), exposures) + margin)
    best.reset();
  return best;
}

double recorded_seconds(const std::filesystem::path& run_folder, std::int64_t iteration) {
  std::ifstream rows(run_folder / "metrics.csv");
  std::string line;
  std::getline(rows, line);
  double seconds = 0;
  while (std::getline(rows, line)) {
    const TrainRow row = first_columns(line);
    if (row.iteration > 0 && row.iteration <= iteration && row.seconds > 0) seconds = row.seconds;
  }
  return seconds;
}

}  // namespace raysplats
