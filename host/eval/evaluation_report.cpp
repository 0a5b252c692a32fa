// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "raysplats/evaluation.hpp"
#include "util/json_text.hpp"

namespace raysplats {
namespace {

nlohmann::json to_json(const EvaluationMetrics& metrics) {
  nlohmann::json json;
  if (!metrics.name.empty()) {
    json["name"] = metrics.name;
    json["center"] = metrics.center;
    json["sharpness"] = metrics.sharpness;
    json["shift"] = metrics.shift;
    json["coarse_sharpness"] = metrics.coarse_sharpness;
  }
  json["psnr"] = metrics.psnr;
  json["ssim"] = metrics.ssim;
  json["psnr_corrected"] = metrics.psnr_corrected;
  json["psnr_shifted"] = metrics.psnr_shifted;
  if (metrics.psnr_aligned) json["psnr_aligned"] = *metrics.psnr_aligned;
  if (metrics.psnr_all) json["psnr_all"] = *metrics.psnr_all;
  if (metrics.lpips) json["lpips"] = *metrics.lpips;
  if (!metrics.picture.empty()) json["picture"] = metrics.picture;
  return json;
}

}  // namespace

std::string EvaluationReport::table() const {
  std::size_t width = 5;
  for (const EvaluationMetrics& image : images) width = std::max(width, image.name.size());
  std::string out =
      fmt::format("{:<{}} {:>8} {:>8} {:>9}{}{}\n", "image", width, "PSNR", "SSIM", "corrected",
                  mean.psnr_aligned ? "  aligned" : "", mean.lpips ? "    LPIPS" : "");
  const auto line = [&](const std::string& name, const EvaluationMetrics& m) {
    out += fmt::format("{:<{}} {:>8.3f} {:>8.4f} {:>9.3f}{}{}\n", name, width, m.psnr, m.ssim,
                       m.psnr_corrected,
                       m.psnr_aligned ? fmt::format(" {:>8.3f}", *m.psnr_aligned) : "",
                       m.lpips ? fmt::format(" {:>8.4f}", *m.lpips) : "");
  };
  for (const EvaluationMetrics& image : images) line(image.name, image);
  line("mean", mean);
  return out;
}

std::string EvaluationReport::json() const {
  nlohmann::json json = to_json(mean);
  json["images"] = nlohmann::json::array();
  for (const EvaluationMetrics& image : images) json["images"].push_back(to_json(image));
  return json_text(json, 2) + "\n";
}

}  // namespace raysplats
