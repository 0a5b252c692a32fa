// SPDX-License-Identifier: Apache-2.0
#include "train/unused_options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <vector>

#include "run/train_option_table.hpp"

namespace raysplats {
namespace {

// Options that are read together.
struct Readers {
  std::vector<std::string> names;
  bool here;          // in this run
  const char* where;  // else
};

std::vector<Readers> readers_of(const TrainOptions& options) {
  const auto by = [&options](DensityStrategy strategy) { return options.strategy == strategy; };
  const bool budget = by(DensityStrategy::kBudget), adc = by(DensityStrategy::kAdc),
             mcmc = by(DensityStrategy::kMcmc);
  const bool model = options.init != "auto" && options.init != "colmap" &&
                     options.init != "photos" && options.init != "random";
  return {
      {{"densify-grad-threshold", "densify-size", "densify-measure", "split-factor", "prune-scale",
        "prune-scale-min"},
       adc,
       "strategy = adc"},
      {{"densify-signal"}, !mcmc, "strategy = budget or adc"},
      {{"replace-until"}, !adc, "strategy = budget or mcmc"},
      {{"prune-weight", "opacity-decay"}, budget, "strategy = budget"},
      {{"opacity-reg", "scale-reg", "mcmc-noise"}, mcmc, "strategy = mcmc"},
      {{"opacity-reset-value"}, options.opacity_reset_every > 0, "opacity-reset-every"},
      {{"sky-degree", "sky-lr", "sky-lr-final"}, options.background == "sky", "background = sky"},
      {{"mirror-bounces"}, !options.mirrors.empty(), "mirrors"},
      {{"init-count"}, !model, "starts that are no model"},
  };
}

}  // namespace

std::string unused_options(const TrainOptions& options) {
  TrainOptions own = options, usual;
  const std::vector<OptionRow> own_rows = train_option_rows(own),
                               usual_rows = train_option_rows(usual);
  const auto changed = [&](const std::string& name) {
    return find_row(own_rows, name)->text() != find_row(usual_rows, name)->text();
  };
  std::string out;
  for (const Readers& readers : readers_of(options)) {
    if (readers.here) continue;
    std::vector<std::string> unused;
    std::ranges::copy_if(readers.names, std::back_inserter(unused), changed);
    if (unused.empty()) continue;
    out += fmt::format("{}{} (for {})", out.empty() ? "" : ", ", fmt::join(unused, ", "),
                       readers.where);
  }
  return out;
}

}  // namespace raysplats
