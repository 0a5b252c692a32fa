// SPDX-License-Identifier: Apache-2.0
#include "bench/card_forecast.hpp"

#include <fmt/format.h>

namespace raysplats {
namespace {

Prediction on_card(const std::string& row, const ExecutedCounts& groups, const Card& card) {
  return predict(executed_work(row, groups), card.speeds,
                 resident_waves(card, compiled_kernel(row, card.target)));
}

double seconds_of(const std::vector<std::string>& rows,
                  const ExecutedCounts& groups,
                  const Card& card) {
  double sum = 0;
  for (const std::string& row : rows) sum += on_card(row, groups, card).seconds;
  return sum;
}

std::string rate_line(const char* name, const std::vector<double>& rates) {
  std::string out = fmt::format("{:<15}", name);
  for (const double rate : rates) out += fmt::format(" {:>9.0f} {:<12}", rate, "");
  return out + "\n";
}

}  // namespace

double view_seconds(const ExecutedCounts& groups, const Card& card) {
  return seconds_of({"prepare-view", "tile-lists", "forward"}, groups, card);
}

// Boxes of the Gaussians and the statistics of density are small beside the others.
double iteration_seconds(const ExecutedCounts& groups, const Card& card) {
  return seconds_of({"prepare-view", "tile-lists", "forward-train", "loss-value", "loss-gradient",
                     "backward", "finalize", "adam"},
                    groups, card);
}

CardForecast forecast_cards(const ExecutedCounts& groups) {
  CardForecast out;
  for (const std::string& name : modelled_rows()) {
    CardForecast::Row row{name, {}};
    for (const Card& card : cards()) row.cards.push_back(on_card(name, groups, card));
    out.rows.push_back(row);
  }
  for (const Card& card : cards()) {
    out.frames.push_back(1 / view_seconds(groups, card));
    out.iterations.push_back(1 / iteration_seconds(groups, card));
  }
  return out;
}

std::string cards_text(const CardForecast& forecast) {
  std::string out = fmt::format("{:<15}", "model, ms");
  for (const Card& card : cards()) out += fmt::format(" {:>22}", card.speeds.name);
  out += "\n";
  for (const CardForecast::Row& row : forecast.rows) {
    out += fmt::format("{:<15}", row.name);
    for (const Prediction& card : row.cards)
      out += fmt::format(" {:>9.3f} {:<12}", 1e3 * card.seconds, card.bound);
    out += "\n";
  }
  return out + rate_line("frames/s", forecast.frames) +
         rate_line("iterations/s", forecast.iterations);
}

}  // namespace raysplats
