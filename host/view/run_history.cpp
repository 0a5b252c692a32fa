// SPDX-License-Identifier: Apache-2.0
#include "view/run_history.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "util/json_text.hpp"

namespace raysplats::view {
namespace {

using Json = nlohmann::json;
using Guard = std::lock_guard<std::mutex>;

constexpr std::size_t kMostRows = 1024;

Json row_json(const TrainRow& row) {
  return {row.iteration, row.seconds, row.loss, row.psnr, row.gaussians};
}

}  // namespace

// What is not finite has no number in JSON, and no place on a curve.
void RunHistory::add(const TrainRow& row) {
  if (!std::isfinite(row.loss) || !std::isfinite(row.psnr)) return;
  const Guard guard(mutex_);
  newest_ = row;
  if (seen_++ % stride_ != 0) return;
  rows_.push_back(row);
  if (rows_.size() < kMostRows) return;
  std::vector<TrainRow> kept;
  for (std::size_t i = 0; i < rows_.size(); i += 2) kept.push_back(rows_[i]);
  rows_ = std::move(kept);
  stride_ *= 2;
}

void RunHistory::add(const EvaluationRow& row) {
  if (!std::isfinite(row.psnr)) return;
  const Guard guard(mutex_);
  tests_.push_back(row);
}

void RunHistory::set_iterations(std::int64_t iterations) {
  const Guard guard(mutex_);
  iterations_ = iterations;
}

void RunHistory::set_state(bool paused, double share) {
  const Guard guard(mutex_);
  paused_ = paused;
  share_ = share;
}

void RunHistory::finish(const std::string& text) {
  const Guard guard(mutex_);
  ended_ = text;
}

std::string RunHistory::json() const {
  const Guard guard(mutex_);
  Json rows = Json::array();
  for (const TrainRow& row : rows_) rows.push_back(row_json(row));
  if (!rows_.empty() && rows_.back().iteration != newest_.iteration)
    rows.push_back(row_json(newest_));
  Json tests = Json::array();
  for (const EvaluationRow& row : tests_) tests.push_back({row.iteration, row.psnr});
  Json left = nullptr;
  if (newest_.iterations_per_second > 0) {
    left = static_cast<double>(iterations_ - newest_.iteration) / newest_.iterations_per_second;
  }
  const Json json{{"iterations", iterations_},
                  {"paused", paused_},
                  {"share", share_},
                  {"ended", ended_},
                  {"rows", rows},
                  {"tests", tests},
                  {"left", left}};
  return json_text(json);
}

}  // namespace raysplats::view
