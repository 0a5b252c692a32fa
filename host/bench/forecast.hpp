// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "bench/bench.hpp"
#include "bench/card_forecast.hpp"
#include "bench/executed_work.hpp"
#include "bench/speed_model.hpp"

namespace raysplats {

/// The speeds of the context's device, by kernels that do nothing else. Of CPUs; others have no
/// names yet for what their instructions cost. Needs a context with keep_launches.
DeviceSpeeds measure_speeds(Context& context);

/// What the model of speed says of a scene's rows on the device at hand, where that is a CPU, and
/// on the cards.
struct Forecast {
  struct Row {
    std::string name;
    double measured = 0;  ///< seconds of the processors' time, the mean
    Prediction device;
  };

  std::string scene;
  std::size_t size = 0;
  int width = 0;
  int height = 0;
  ExecutedCounts vectors, groups;
  std::vector<Row> rows;  ///< modelled_rows()
  CardForecast cards;
};

struct ForecastReport {
  DeviceSpeeds device;
  std::vector<Forecast> forecasts;
};

/// Measures the device's speeds and the rows, counts their work in both forms and predicts. Of one
/// model or, where it is null, of options' scenes and sizes. CPUs only.
ForecastReport make_forecast(Context& context,
                             const BenchOptions& options,
                             const BenchModel* model = nullptr);

/// Fixed-width text.
std::string forecast_text(const ForecastReport& report);

}  // namespace raysplats
