// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "bench/cards.hpp"
#include "bench/executed_work.hpp"
#include "bench/speed_model.hpp"

namespace raysplats {

/// What the model of speed says of a scene on cards().
struct CardForecast {
  struct Row {
    std::string name;
    std::vector<Prediction> cards;
  };
  std::vector<Row> rows;                   ///< modelled_rows()
  std::vector<double> frames, iterations;  ///< a second
};

/// What the cards would take, from the work that kernels of their form do.
CardForecast forecast_cards(const ExecutedCounts& groups);

/// Rows on a card: what a picture, or a training iteration, takes.
double view_seconds(const ExecutedCounts& groups, const Card& card);
double iteration_seconds(const ExecutedCounts& groups, const Card& card);

/// Fixed-width text.
std::string cards_text(const CardForecast& forecast);

}  // namespace raysplats
