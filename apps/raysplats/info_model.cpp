// SPDX-License-Identifier: Apache-2.0
#include "info_model.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>

#include "raysplats/io.hpp"
#include "run/model_source.hpp"
#include "scene/gaussians/model_summary.hpp"
#include "scene/options/trace_option_table.hpp"

namespace raysplats::cli {
namespace {

using Json = nlohmann::ordered_json;

Json describe(const ModelSummary& model) {
  return {{"gaussians", model.count},
          {"sh_degree", model.sh_degree},
          {"bounds", {model.minimum, model.maximum}},
          {"bounds_98_percent", {model.inner_minimum, model.inner_maximum}},
          {"scale_quantiles", model.scale_quantiles},
          {"median_anisotropy", model.median_anisotropy},
          {"mean_opacity", model.mean_opacity},
          {"opacity_histogram", model.opacity_histogram}};
}

Json describe(const TraceOptions& trace) {
  return {{"hit_order", hit_order_name(trace.hit_order)}, {"quantile", trace.quantile},
          {"adaptive_radius", trace.adaptive_radius},     {"near_depth", trace.near_depth},
          {"min_transmittance", trace.min_transmittance}, {"max_hits", trace.max_hits},
          {"view_footprint", trace.view_footprint},       {"background", trace.background}};
}

void print(const ModelSummary& model) {
  const auto vector = [](const std::array<double, 3>& v) {
    return fmt::format("({:.4g}, {:.4g}, {:.4g})", v[0], v[1], v[2]);
  };
  const auto& q = model.scale_quantiles;
  fmt::print("Gaussians        {}, SH degree {}\n", model.count, model.sh_degree);
  if (model.count == 0) return;
  fmt::print("bounds           {} to {}\n", vector(model.minimum), vector(model.maximum));
  fmt::print("98 % of them     {} to {}\n", vector(model.inner_minimum),
             vector(model.inner_maximum));
  fmt::print(
      "scales           {:.3g} least, {:.3g} at 5 %, {:.3g} median, {:.3g} at 95 %, {:.3g} most\n",
      q[0], q[1], q[2], q[3], q[4]);
  fmt::print("anisotropy       {:.3g} median of largest over smallest scale\n",
             model.median_anisotropy);
  fmt::print("opacity          {:.3f} mean\n", model.mean_opacity);
  const std::size_t bins = model.opacity_histogram.size();
  const std::size_t most =
      *std::max_element(model.opacity_histogram.begin(), model.opacity_histogram.end());
  for (std::size_t k = 0; k < bins; ++k) {
    const std::size_t count = model.opacity_histogram[k];
    fmt::print("  {:.1f} to {:.1f}     {:>9} {}\n",
               static_cast<double>(k) / static_cast<double>(bins),
               static_cast<double>(k + 1) / static_cast<double>(bins), count,
               std::string(40 * count / most, '#'));
  }
}

}  // namespace

Json describe_model(const std::filesystem::path& path) {
  const ModelSource source = find_model(path);
  Json out{{"type", is_run_folder(path) ? "run" : "model"},
           {"path", path.string()},
           {"model", source.file.string()}};
  if (source.iteration) out["iteration"] = *source.iteration;
  if (source.trained) out["iterations"] = source.trained->iterations;
  if (source.header) out["trace"] = describe(*source.header);
  if (!source.sky.empty()) out["sky"] = source.sky;
  if (source.origin != std::array<double, 3>{}) out["origin"] = source.origin;
  out.update(describe(summarize(read_model(source.file))));
  return out;
}

void print_model(const std::filesystem::path& path) {
  const ModelSource source = find_model(path);
  const ModelSummary summary = summarize(read_model(source.file));
  if (is_run_folder(path)) {
    fmt::print("run              {}\n", path.string());
    fmt::print("model            {}\n", source.file.string());
    if (source.trained)
      fmt::print("trained          {} of {} iterations\n", *source.iteration,
                 source.trained->iterations);
  }
  print(summary);
  if (source.header) {
    fmt::print("traced           in {} order, quantile {:.4g}, {} radius, view footprint {:.4g}\n",
               hit_order_name(source.header->hit_order), source.header->quantile,
               source.header->adaptive_radius ? "adaptive" : "whole",
               source.header->view_footprint);
    if (source.sky.empty())
      fmt::print("background       {}\n", fmt::join(source.header->background, ", "));
  }
  if (!source.sky.empty()) {
    fmt::print("sky              trained, by direction, {} coefficients a channel\n",
               source.sky.size());
  }
  if (source.origin != std::array<double, 3>{}) {
    fmt::print("origin           {}, {}, {}: positions count from there\n", source.origin[0],
               source.origin[1], source.origin[2]);
  }
}

}  // namespace raysplats::cli
