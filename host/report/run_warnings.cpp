// SPDX-License-Identifier: Apache-2.0
#include "report/run_warnings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "report/run_files.hpp"
#include "util/number_text.hpp"

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

double itself(double value) { return value; }
double octaves(double sharpness) { return std::log2(std::max(sharpness, 1e-12)); }

/// The views whose number `key`, on its `scale`, lies far below the median: by 3.5 robust standard
/// deviations (Iglewicz and Hoaglin 1993) and by `least`. Views without that number are left
/// out.
std::vector<Json> far_below(std::vector<Json> views,
                            const char* key,
                            double (*scale)(double),
                            double least) {
  constexpr double kDeviations = 3.5;
  constexpr double kOfNormal = 1.4826;  // standard deviations in a median of absolute deviations
  std::erase_if(views, [&](const Json& view) { return !view.contains(key); });
  if (views.size() < kFewViews) return {};
  std::vector<double> values;
  values.reserve(views.size());
  for (const Json& view : views) values.push_back(scale(number(view, key)));
  const double middle = median(values);
  std::vector<double> deviations = values;
  for (double& each : deviations) each = std::abs(each - middle);
  const double below = std::max(least, kDeviations * kOfNormal * median(deviations));
  std::erase_if(views,
                [&](const Json& view) { return !(scale(number(view, key)) < middle - below); });
  return views;
}

/// Their names; "" for none.
std::string names_of(const std::vector<Json>& views) {
  std::string names;
  for (std::size_t i = 0; i < std::min(views.size(), kNamed); ++i)
    names += (i == 0 ? "" : ", ") + text(views[i], "name");
  return views.size() > kNamed ? fmt::format("{} and {} more", names, views.size() - kNamed)
                               : names;
}

double coordinate(const Json& photo, std::size_t axis) {
  const auto center = photo.find("center");
  const bool sound = center != photo.end() && center->is_array() && center->size() == 3 &&
                     (*center)[axis].is_number();
  return sound ? (*center)[axis].get<double>() : 0.0;
}

/// The squared distance between the places that two photos were taken at.
double squared_distance(const Json& a, const Json& b) {
  double sum = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double along = coordinate(a, k) - coordinate(b, k);
    sum += along * along;
  }
  return sum;
}

bool is_complete(const Json& metrics) {
  const auto complete = metrics.find("complete");
  return complete != metrics.end() && complete->is_boolean() && complete->get<bool>();
}

/// The best of the evaluations of as many views as the last: with --eval-views those before it are
/// of fewer, which may be easier ones. Null for none.
Json best_like_last(const std::vector<Json>& evaluations) {
  Json best;
  for (const Json& each : evaluations) {
    if (number(each, "views") != number(evaluations.back(), "views")) continue;
    if (best.is_null() || number(each, "psnr") > number(best, "psnr")) best = each;
  }
  return best;
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

std::string blurred(const std::vector<Json>& photos) {
  return names_of(far_below(photos, "sharpness", octaves, kBlurredOctaves));
}

/// Training photos that the model comes far less near to than to the others, and than to those from
/// the two nearest places: what lies at the border of a capture is learned later, all of it.
std::string odd(const std::vector<Json>& photos) {
  constexpr std::size_t kNeighbours = 2;
  std::vector<Json> found = far_below(photos, "psnr", itself, kOddDecibels);
  std::erase_if(found, [&](const Json& photo) {
    std::vector<std::pair<double, double>> others;  // squared distance, PSNR
    for (const Json& other : photos) {
      if (other.contains("psnr") && text(other, "name") != text(photo, "name"))
        others.emplace_back(squared_distance(photo, other), number(other, "psnr"));
    }
    std::sort(others.begin(), others.end());
    others.resize(std::min(others.size(), kNeighbours));
    return std::any_of(others.begin(), others.end(), [&](const auto& other) {
      return number(photo, "psnr") > other.second - kOddDecibels;
    });
  });
  return names_of(found);
}

/// About views that stand out, which tells of their photos and poses more than of the model.
void warn_of_views(const std::vector<Json>& views,
                   const std::vector<Json>& photos,
                   std::vector<std::string>& out) {
  const auto warn = [&](const char* what, const std::string& names) {
    if (!names.empty()) out.push_back(what + names);
  };
  warn("Views far worse than the others, whose pose or photo may be wrong: ",
       names_of(far_below(views, "psnr", itself, kOddDecibels)));
  warn("Held-out photos less sharp than the others: ", blurred(views));
  warn("Training photos less sharp than the others, which blur the model: ", blurred(photos));
  warn(
      "Training photos that the model comes far less near to than to the others; their pose or "
      "exposure may be wrong, or something in them has moved: ",
      odd(photos));
}

}  // namespace

std::string verdict(const Json& metrics, std::size_t warnings) {
  const std::vector<Json> evaluations = objects(metrics, "evaluations");
  std::string quality = is_complete(metrics) ? "no held-out views" : "nothing measured yet";
  if (!evaluations.empty()) {
    const Json& last = evaluations.back();
    quality = fmt::format("{:.1f} dB on {}", number(last, "psnr"),
                          counted(number(last, "views"), "held-out view"));
    if (last.contains("psnr_aligned"))
      quality += fmt::format(", {:.1f} dB where they fit", number(last, "psnr_aligned"));
  }
  return fmt::format("{}: {}, {}.", is_complete(metrics) ? "Complete" : "Not over", quality,
                     warnings == 0 ? "nothing to warn of" : counted(warnings, "warning"));
}

std::string warnings_line(const std::vector<std::string>& warnings,
                          const std::filesystem::path& file) {
  if (warnings.empty()) return "";
  return fmt::format("{} in {}{}: {}", counted(warnings.size(), "warning"), file.string(),
                     warnings.size() > 1 ? ", the first" : "", warnings.front());
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
  const Json best = best_like_last(evaluations);
  if (!best.is_null()) {
    const double below = number(best, "psnr") - number(evaluations.back(), "psnr");
    if (below > kBelowBest) {
      out.push_back(fmt::format("The run ends {:.2f} dB below its best, at iteration {:.0f}", below,
                                number(best, "iteration")));
    }
  }
  if (stopped_growing(metrics, settings, columns)) {
    out.push_back(
        fmt::format("The number of Gaussians stopped at its limit of {:.0f}: raise --max-gaussians",
                    number(metrics, "most_gaussians")));
  }
  warn_of_views(views, objects(metrics, "photos"), out);
  return out;
}

}  // namespace raysplats::report
