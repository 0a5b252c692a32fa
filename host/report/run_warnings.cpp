// SPDX-License-Identifier: Apache-2.0
#include "report/run_warnings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "report/run_files.hpp"

namespace raysplats::report {
namespace {

using Json = nlohmann::json;

constexpr double kCappedShare = 1e-3;  ///< of rays, from which the cap on hits is worth a warning
constexpr double kBelowBest = 0.1;     ///< dB
constexpr double kNothingLearned = 0.1;
constexpr double kFullShare = 0.99;  ///< of the most Gaussians; passes leave out the last few
constexpr double kOddDecibels = 3.0;
constexpr double kBlurredOctaves = 2.0;
constexpr std::size_t kFewViews = 5;  ///< of which none can be called odd
constexpr std::size_t kNamed = 4;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Names of the views whose value lies far below the median: by 3.5 robust standard deviations
/// (Iglewicz and Hoaglin 1993) and by `least`; "" for none.
std::string far_below(const std::vector<Json>& views,
                      const std::vector<double>& values,
                      double least) {
  constexpr double kDeviations = 3.5;
  constexpr double kOfNormal = 1.4826;  // standard deviations in a median of absolute deviations
  if (views.size() < kFewViews) return "";
  const double middle = median(values);
  std::vector<double> deviations = values;
  for (double& each : deviations) each = std::abs(each - middle);
  const double below = std::max(least, kDeviations * kOfNormal * median(deviations));
  std::string names;
  std::size_t count = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (!(values[i] < middle - below)) continue;
    if (count++ < kNamed) names += (names.empty() ? "" : ", ") + text(views[i], "name");
  }
  return count > kNamed ? fmt::format("{} and {} more", names, count - kNamed) : names;
}

bool is_complete(const Json& metrics) {
  const auto complete = metrics.find("complete");
  return complete != metrics.end() && complete->is_boolean() && complete->get<bool>();
}

std::string counted(double number, const char* thing) {
  return fmt::format("{:.0f} {}{}", number, thing, number == 1.0 ? "" : "s");
}

/// Whether the limit has cut off growth. The other strategies go there by plan.
bool stopped_growing(const Json& metrics,
                     const std::map<std::string, std::string>& settings,
                     const std::map<std::string, std::vector<double>>& columns) {
  const auto strategy = settings.find("strategy");
  const auto count = columns.find("gaussians");
  if (strategy == settings.end() || strategy->second != "\"adc\"") return false;
  if (count == columns.end() || count->second.empty()) return false;
  const double most = kFullShare * number(metrics, "most_gaussians");
  return most > 0 && count->second.front() < most &&
         *std::max_element(count->second.begin(), count->second.end()) >= most;
}

/// Names of the photos that are far less sharp than the others; "" for none.
std::string blurred(const std::vector<Json>& photos) {
  std::vector<double> octaves;
  octaves.reserve(photos.size());
  for (const Json& photo : photos)
    octaves.push_back(std::log2(std::max(number(photo, "sharpness"), 1e-12)));
  return far_below(photos, octaves, kBlurredOctaves);
}

/// About views that stand out, which tells of their photos and poses more than of the model.
void warn_of_views(const std::vector<Json>& views, std::vector<std::string>& out) {
  std::vector<double> psnr;
  psnr.reserve(views.size());
  for (const Json& view : views) psnr.push_back(number(view, "psnr"));
  const std::string odd = far_below(views, psnr, kOddDecibels);
  if (!odd.empty()) {
    out.push_back("Views far worse than the others, whose pose or photo may be wrong: " + odd);
  }
  if (const std::string names = blurred(views); !names.empty())
    out.push_back("Held-out photos less sharp than the others: " + names);
}

}  // namespace

std::string verdict(const Json& metrics, std::size_t warnings) {
  const std::vector<Json> evaluations = objects(metrics, "evaluations");
  const std::string quality =
      evaluations.empty()
          ? "no held-out views"
          : fmt::format("{:.1f} dB on {}", number(evaluations.back(), "psnr"),
                        counted(number(evaluations.back(), "views"), "held-out view"));
  return fmt::format(
      "{}: {}, {}.", is_complete(metrics) ? "Complete" : "Not over", quality,
      warnings == 0 ? "nothing to warn of" : counted(static_cast<double>(warnings), "warning"));
}

std::vector<std::string> warnings_of(const Json& metrics,
                                     const std::map<std::string, std::string>& settings,
                                     const std::map<std::string, std::vector<double>>& columns,
                                     const std::vector<Json>& views) {
  const std::vector<Json> evaluations = objects(metrics, "evaluations");
  std::vector<std::string> out;
  if (!is_complete(metrics)) {
    out.push_back(fmt::format("The run is not over: {:.0f} of {:.0f} iterations",
                              number(metrics, "iteration"), number(metrics, "iterations")));
  }
  const double rays = number(metrics, "traced_rays");
  const double capped = number(metrics, "capped_rays");
  if (capped > kCappedShare * rays) {
    out.push_back(fmt::format("{:.2f} % of the rays stopped at --max-hits: raise it",
                              100.0 * capped / std::max(rays, 1.0)));
  }
  if (number(metrics, "bad_steps") > 0 || number(metrics, "skipped_updates") > 0) {
    out.push_back(fmt::format("{:.0f} steps were not finite, {:.0f} updates were left out",
                              number(metrics, "bad_steps"), number(metrics, "skipped_updates")));
  }
  const auto rise = metrics.find("psnr_rise");
  if (rise != metrics.end() && rise->is_number() && rise->get<double>() < kNothingLearned)
    out.emplace_back("No view became better by 0.1 dB: poses or photos may be wrong");
  if (evaluations.size() > 1) {
    const auto best = std::max_element(
        evaluations.begin(), evaluations.end(),
        [](const Json& a, const Json& b) { return number(a, "psnr") < number(b, "psnr"); });
    const double below = number(*best, "psnr") - number(evaluations.back(), "psnr");
    if (below > kBelowBest) {
      out.push_back(fmt::format("The run ends {:.2f} dB below its best, at iteration {:.0f}", below,
                                number(*best, "iteration")));
    }
  }
  if (stopped_growing(metrics, settings, columns)) {
    out.push_back(
        fmt::format("The number of Gaussians stopped at its limit of {:.0f}: raise --max-gaussians",
                    number(metrics, "most_gaussians")));
  }
  warn_of_views(views, out);
  if (const std::string names = blurred(objects(metrics, "photos")); !names.empty())
    out.push_back("Training photos less sharp than the others, which blur the model: " + names);
  return out;
}

}  // namespace raysplats::report
