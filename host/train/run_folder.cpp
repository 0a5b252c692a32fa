// SPDX-License-Identifier: Apache-2.0
#include "train/run_folder.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/atomic_file.hpp"
#include "base/output_directory.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "train/train_config.hpp"

namespace raysplats {
namespace {

constexpr char kCsvHeader[] = "iteration,seconds,loss,psnr,gaussians,it_per_s\n";

std::ptrdiff_t columns(std::string_view row) { return std::count(row.begin(), row.end(), ','); }

nlohmann::json to_json(const EvaluationRow& row) {
  return {{"iteration", row.iteration}, {"training_seconds", row.training_seconds},
          {"psnr", row.psnr},           {"ssim", row.ssim},
          {"views", row.views},         {"gaussians", row.gaussians}};
}

EvaluationRow evaluation_from_json(const nlohmann::json& json) {
  EvaluationRow row;
  json.at("iteration").get_to(row.iteration);
  json.at("training_seconds").get_to(row.training_seconds);
  json.at("psnr").get_to(row.psnr);
  json.at("ssim").get_to(row.ssim);
  json.at("views").get_to(row.views);
  json.at("gaussians").get_to(row.gaussians);
  return row;
}

}  // namespace

RunFolder::RunFolder(std::filesystem::path path) : path_(std::move(path)) {
  make_output_directory(path_);
}

FileLock RunFolder::lock() const {
  FileLock lock(path_ / ".lock");
  const std::size_t stale = remove_stale_temporaries(path_);
  if (stale > 0) spdlog::info("{} temporary files of a run that was killed are removed", stale);
  return lock;
}

std::filesystem::path RunFolder::evaluation_folder(std::int64_t iteration) const {
  return path_ / "eval" / fmt::format("iteration_{}", iteration);
}

void RunFolder::write_config(const TrainOptions& options) const {
  write_text_file(path_ / "config.toml", to_toml(options));
}

void RunFolder::write_cameras(std::span<const Camera> cameras) const {
  nlohmann::json list = nlohmann::json::array();
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera& camera = cameras[i];
    const glm::dvec3 center = camera.center();
    nlohmann::json rotation = nlohmann::json::array();
    // Row r, column c of camera-to-world; glm's m[column][row] of the inverse, which is the
    // transpose.
    for (int r = 0; r < 3; ++r) {
      rotation.push_back({camera.rotation[r][0], camera.rotation[r][1], camera.rotation[r][2]});
    }
    list.push_back({{"id", i},
                    {"img_name", camera.name},
                    {"width", camera.width},
                    {"height", camera.height},
                    {"position", {center.x, center.y, center.z}},
                    {"rotation", rotation},
                    {"fy", camera.fy},
                    {"fx", camera.fx}});
  }
  write_text_file(path_ / "cameras.json", list.dump() + "\n");
}

void RunFolder::write_model(const Gaussians& model,
                            const TraceOptions& trace,
                            std::int64_t iteration) const {
  write_ply(path_ / "point_cloud" / fmt::format("iteration_{}", iteration) / "point_cloud.ply",
            model, trace);
}

void RunFolder::begin_metrics(std::int64_t iteration) {
  evaluations_.clear();
  std::string csv = kCsvHeader;
  if (iteration > 0) {
    std::ifstream rows(path_ / "metrics.csv");
    std::string line;
    std::getline(rows, line);
    while (std::getline(rows, line)) {
      const long long recorded = std::strtoll(line.c_str(), nullptr, 10);
      // Rows that a power failure cut off are dropped.
      if (recorded > 0 && recorded <= iteration && columns(line) == columns(kCsvHeader))
        csv += line + "\n";
    }
    std::ifstream metrics(path_ / "metrics.json");
    try {
      const nlohmann::json old = nlohmann::json::parse(metrics);
      for (const nlohmann::json& entry : old.at("evaluations")) {
        const EvaluationRow row = evaluation_from_json(entry);
        if (row.iteration <= iteration) evaluations_.push_back(row);
      }
    } catch (const nlohmann::json::exception&) {
      // Reports of an earlier run that cannot be read are no reason not to train.
    }
  }
  write_text_file(path_ / "metrics.csv", csv);
}

void RunFolder::append(const TrainRow& row) {
  std::ofstream stream(path_ / "metrics.csv", std::ios::app);
  stream << fmt::format("{},{:.3f},{:.7g},{:.4f},{},{:.3f}\n", row.iteration, row.seconds, row.loss,
                        row.psnr, row.gaussians, row.iterations_per_second);
  stream.flush();
  if (!stream.good()) {
    throw DataError(fmt::format("{} cannot be written: {}", (path_ / "metrics.csv").string(),
                                std::strerror(errno)));
  }
}

void RunFolder::record(const EvaluationRow& row) { evaluations_.push_back(row); }

void RunFolder::write_metrics(const nlohmann::json& summary) const {
  nlohmann::json json = summary;
  json["evaluations"] = nlohmann::json::array();
  for (const EvaluationRow& row : evaluations_) json["evaluations"].push_back(to_json(row));
  json["note"] = "training_seconds exclude evaluation and compiling kernels";
  write_text_file(path_ / "metrics.json", json.dump(2) + "\n");
}

double recorded_seconds(const std::filesystem::path& run_folder, std::int64_t iteration) {
  std::ifstream rows(run_folder / "metrics.csv");
  std::string line;
  std::getline(rows, line);
  double seconds = 0;
  while (std::getline(rows, line)) {
    char* end = nullptr;
    const long long recorded = std::strtoll(line.c_str(), &end, 10);
    if (recorded <= 0 || recorded > iteration || *end != ',') continue;
    const double value = std::strtod(end + 1, nullptr);
    if (value >= 0 && std::isfinite(value)) seconds = value;
  }
  return seconds;
}

}  // namespace raysplats
