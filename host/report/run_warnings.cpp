// SPDX-License-Identifier: Apache-2.0
#include "report/run_warnings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <glm/glm.hpp>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "eval/photo_agreement.hpp"
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
constexpr double kColorsDecibels = 1.5;
constexpr double kShiftDecibels = 0.5;  ///< of sound captures none gained more than 0.1
constexpr double kBlurredOctaves = 2.0;
constexpr std::size_t kFewViews = 5;  ///< of which none can be called odd
constexpr std::size_t kNamed = 4;

using Settings = std::map<std::string, std::string>;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double itself(double value) { return value; }
double octaves(double sharpness) { return std::log2(std::max(sharpness, 1e-12)); }

/// The views whose number `key`, on its `scale`, lies far below the median: by 3.5 robust standard
/// deviations (Iglewicz and Hoaglin 1993) and by `least`, both so many `times`. Views without that
/// number are left out.
std::vector<Json> far_below(std::vector<Json> views,
                            const char* key,
                            double (*scale)(double),
                            double least,
                            double times = 1.0) {
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
  const double below = times * std::max(least, kDeviations * kOfNormal * median(deviations));
  std::erase_if(views,
                [&](const Json& view) { return !(scale(number(view, key)) < middle - below); });
  return views;
}

/// Their names, of at most so many; "" for none.
std::string names_of(const std::vector<Json>& views, std::size_t most = kNamed) {
  std::string names;
  for (std::size_t i = 0; i < std::min(views.size(), most); ++i)
    names += (i == 0 ? "" : ", ") + text(views[i], "name");
  return views.size() > most ? fmt::format("{} and {} more", names, views.size() - most) : names;
}

/// Three numbers of a photo; nothing where they are missing.
std::optional<glm::dvec3> vector_of(const Json& photo, const char* key) {
  const auto found = photo.find(key);
  if (found == photo.end() || !found->is_array() || found->size() != 3) return std::nullopt;
  glm::dvec3 out;
  for (int k = 0; k < 3; ++k) {
    const Json& part = (*found)[static_cast<std::size_t>(k)];
    if (!part.is_number()) return std::nullopt;
    out[k] = part.get<double>();
  }
  return out;
}

/// The photos that the model was compared with and that steps show to the end.
std::vector<Json> compared(const std::vector<Json>& photos) {
  std::vector<Json> out = photos;
  std::erase_if(out, [](const Json& photo) {
    return !photo.contains("psnr") || photo.contains("left_out_from");
  });
  return out;
}

/// These, with their places; those that nothing is known of lie at 0.
std::vector<PlacedPhoto> placed(const std::vector<Json>& photos) {
  std::vector<PlacedPhoto> out;
  out.reserve(photos.size());
  for (const Json& photo : photos) {
    out.push_back({number(photo, "psnr"), vector_of(photo, "center").value_or(glm::dvec3(0)),
                   vector_of(photo, "direction")});
  }
  return out;
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

/// Whether the steps up to an iteration have shown every training photo so many times, or so many
/// photos that the model is far along though there are more of them.
bool has_visited(const Json& metrics, const Settings& settings, double iteration, double times) {
  constexpr double kManyViews = 3000;
  const auto found = settings.find("views-per-step");
  const std::optional<double> views =
      found != settings.end() ? parse_real(found->second) : std::nullopt;
  const auto photos = static_cast<double>(objects(metrics, "photos").size());
  return iteration * views.value_or(1.0) >= std::min(times * photos, kManyViews);
}

/// Whether held-out photos tell of exposure or poses: a run that does not train these (an `option`)
/// has looked at them when its model was no longer on its way.
bool tells_without(const char* option, const Json& metrics, const Settings& settings) {
  constexpr double kSteps = 100, kVisits = 3;
  const std::vector<Json> evaluations = objects(metrics, "evaluations");
  const auto trained = settings.find(option);
  if (evaluations.empty() || (trained != settings.end() && trained->second == "true")) return false;
  const double iteration = number(evaluations.back(), "iteration");
  return iteration >= kSteps && has_visited(metrics, settings, iteration, kVisits);
}

/// What views gain over their PSNR by another one, in dB: in the mean, but in the median where that
/// is less, as what concerns a few of them is no matter of all. Nothing where no view has it.
std::optional<double> usual_gain(const std::vector<Json>& views, const char* key) {
  double sum = 0;
  std::vector<double> gains;
  for (const Json& view : views) {
    if (!view.contains("psnr") || !view.contains(key)) continue;
    gains.push_back(number(view, key) - number(view, "psnr"));
    sum += gains.back();
  }
  if (gains.empty()) return std::nullopt;
  const double mean = sum / static_cast<double>(gains.size());
  return std::min(mean, median(std::move(gains)));
}

/// How much nearer held-out photos are to the model once their colours are fitted, in dB, where
/// that tells of exposure; 0 elsewhere.
double gained_by_colors(const std::vector<Json>& views,
                        const Json& metrics,
                        const Settings& settings) {
  // Fitted colours bring any photo near to a model that fails: dB, and how near where they bring
  // much, as they do where lamps flicker.
  constexpr double kNear = 22, kRatherNear = 20.5, kMuch = 3;
  constexpr double kSeen = 0.025;  // root of the mean square; less is nothing of a dark scene
  if (!tells_without("exposure", metrics, settings)) return 0;
  const Json last = objects(metrics, "evaluations").back();
  const double plain = number(last, "psnr"), fitted = number(last, "psnr_corrected");
  const double square = std::pow(10.0, -plain / 10.0) - std::pow(10.0, -fitted / 10.0);
  const double near = fitted - plain >= kMuch ? kRatherNear : kNear;
  if (fitted < near || square <= kSeen * kSeen) return 0;
  return usual_gain(views, "psnr_corrected").value_or(fitted - plain);
}

/// How much nearer held-out photos are to the model once each is shifted in its plane, in dB; 0
/// where that tells nothing of poses.
double gained_by_shift(const std::vector<Json>& views,
                       const Json& metrics,
                       const Settings& settings) {
  if (!tells_without("poses", metrics, settings)) return 0;
  return usual_gain(views, "psnr_shifted").value_or(0);
}

/// By how many pixels views are shifted then, in the median; 0 where none says so.
double usual_shift(const std::vector<Json>& views) {
  std::vector<double> pixels;
  for (const Json& view : views) {
    const auto shift = view.find("shift");
    if (shift == view.end() || !shift->is_array() || shift->size() != 2 ||
        !(*shift)[0].is_number() || !(*shift)[1].is_number())
      continue;
    pixels.push_back(std::hypot((*shift)[0].get<double>(), (*shift)[1].get<double>()));
  }
  return pixels.empty() ? 0 : median(std::move(pixels));
}

/// Whether the limit has cut off growth. The other strategies go there by plan.
bool stopped_growing(const Json& metrics,
                     const Settings& settings,
                     const std::map<std::string, std::vector<double>>& columns) {
  const auto strategy = settings.find("strategy");
  const auto count = columns.find("gaussians");
  if (strategy == settings.end() || strategy->second != "\"adc\"") return false;
  if (count == columns.end() || count->second.empty()) return false;
  const double most = kFullShare * number(metrics, "most_gaussians");
  return most > 0 && count->second.front() < most &&
         *std::max_element(count->second.begin(), count->second.end()) >= most;
}

/// Photos far less sharp than the others, but those in which there is as little to see at large, as
/// of a plain wall: their pixels differ no less from what the reduced photo shows.
std::string blurred(const std::vector<Json>& photos) {
  constexpr double kLostOctaves = 1.0;
  const auto lost = [](const Json& photo) {
    return octaves(number(photo, "coarse_sharpness")) - octaves(number(photo, "sharpness"));
  };
  std::vector<Json> found = far_below(photos, "sharpness", octaves, kBlurredOctaves);
  std::vector<double> usual;
  for (const Json& photo : photos) {
    if (photo.contains("sharpness") && photo.contains("coarse_sharpness"))
      usual.push_back(lost(photo));
  }
  if (usual.empty()) return names_of(found);  // of a run before both were measured
  const double middle = median(std::move(usual));
  // What an older version has read of a run, and this one has not yet, tells less.
  std::erase_if(found, [&](const Json& photo) {
    return photo.contains("coarse_sharpness") && lost(photo) < middle + kLostOctaves;
  });
  return names_of(found);
}

/// Photos that show one colour, at large too, as behind a lens cap; noise may lie on it.
std::string plain(const std::vector<Json>& photos) {
  constexpr double kPlainOctaves = 8.0;
  return names_of(far_below(photos, "coarse_sharpness", octaves, kPlainOctaves));
}

/// Training photos that the model comes far less near to than to the others, and than to the two
/// beside them: what lies at the border of a capture is learned later, all of it. The distances
/// count so many `times`, and twice that for photos that no two look the same way as: each shows
/// what none of the others does.
std::string odd(const std::vector<Json>& photos, double times) {
  constexpr std::size_t kNeighbours = 2;
  constexpr std::size_t kLeast = 12;  // of fewer photos each shows much that no other does
  constexpr double kAlone = 2.0, kDegrees = 45;
  if (photos.size() < kLeast) return "";
  const std::vector<PlacedPhoto> places = placed(photos);
  const auto names_below = [&](double of) {
    std::set<std::string> names;
    for (const Json& photo : far_below(photos, "psnr", itself, kOddDecibels, of))
      names.insert(text(photo, "name"));
    return names;
  };
  const std::set<std::string> below = names_below(times), farther = names_below(kAlone * times);
  std::vector<Json> found;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    if (!below.contains(text(photos[i], "name"))) continue;
    const std::vector<std::size_t> beside =
        photos_beside(places, i, kDegrees, kNeighbours, kNoBound);
    const bool alone = beside.size() < kNeighbours;
    if (alone && !farther.contains(text(photos[i], "name"))) continue;
    const double least = (alone ? kAlone : 1.0) * times * kOddDecibels;
    const auto is_near = [&](std::size_t other) {
      return places[i].psnr > places[other].psnr - least;
    };
    if (std::none_of(beside.begin(), beside.end(), is_near)) found.push_back(photos[i]);
  }
  return names_of(found);
}

/// As contradicted_photos(): these are to be removed, so that many are named.
std::string contradicted(const std::vector<Json>& photos) {
  constexpr std::size_t kMost = 24;
  std::vector<Json> found;
  for (const std::size_t photo : contradicted_photos(placed(photos)))
    found.push_back(photos[photo]);
  return names_of(found, kMost);
}

/// Those that the run has left out itself.
std::string left_out(std::vector<Json> photos) {
  constexpr std::size_t kMost = 24;
  std::erase_if(photos, [](const Json& photo) { return !photo.contains("left_out_from"); });
  return names_of(photos, kMost);
}

/// What the run has warned of before its first step.
std::vector<std::string> told_of_capture(const Json& metrics) {
  std::vector<std::string> out;
  for (const char* key : {"photo_warnings", "camera_warnings"}) {
    const auto list = metrics.find(key);
    if (list == metrics.end() || !list->is_array()) continue;
    for (const Json& each : *list) {
      if (!each.is_string() || each.get_ref<const std::string&>().empty()) continue;
      out.push_back(each.get<std::string>());
      char& first = out.back().front();
      first = static_cast<char>(std::toupper(static_cast<unsigned char>(first)));
    }
  }
  return out;
}

/// About views that stand out, which tells of their photos and poses more than of the model.
void warn_of_views(const std::vector<Json>& views,
                   const Json& metrics,
                   const Settings& settings,
                   std::vector<std::string>& out) {
  // A model that has seen its photos a few times is still better here than there: unaltered
  // captures had photos up to 10 dB and 5.3 robust deviations below the others, those with wrong
  // poses or photos from 14 dB and 7.3 on.
  constexpr double kVisits = 10, kTimesBefore = 2.0;
  const bool settled = has_visited(metrics, settings, number(metrics, "iteration"), kVisits);
  const std::vector<Json> photos = objects(metrics, "photos");
  const auto warn = [&](const char* what, const std::string& names) {
    if (!names.empty()) out.push_back(what + names);
  };
  warn(
      "Views far worse than the others; pose or photo may be wrong, or few photos show that part: ",
      names_of(far_below(views, "psnr", itself, kOddDecibels)));
  warn("Training photos of one colour, which hide what is there: leave them out: ", plain(photos));
  warn("Held-out photos less sharp than the others: ", blurred(views));
  warn("Training photos less sharp than the others, which blur the model: ", blurred(photos));
  warn(
      "Training photos that the model comes far less near to than to the others; their pose or "
      "exposure may be wrong, few others show what they do, or something in them has moved: ",
      odd(compared(photos), settled ? 1.0 : kTimesBefore));
  warn(
      "Training photos that contradict others from beside them, as where a reconstruction takes "
      "one side of an object for another; find the poses anew, or remove these and the like: ",
      contradicted(compared(photos)));
  warn(
      "Training photos that were left out, because they contradict others from beside them; their "
      "pose may be wrong, or something in them has moved: ",
      left_out(photos));
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
    const double done = number(metrics, "iteration"), all = number(metrics, "iterations");
    // Its last evaluation was broken off.
    const bool trained = all > 0 && done >= all;
    out.push_back(
        trained ? fmt::format("The run is not over, though all {:.0f} iterations are done", all)
                : fmt::format("The run is not over: {:.0f} of {:.0f} iterations", done, all));
  }
  for (std::string& warning : told_of_capture(metrics)) out.push_back(std::move(warning));
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
  if (const double gain = gained_by_colors(views, metrics, settings); gain > kColorsDecibels) {
    out.push_back(fmt::format(
        "Held-out photos are {:.1f} dB nearer to the model once their colours are fitted, as where "
        "exposure or white balance changes between photos: try --exposure, and "
        "judge it by psnr_corrected",
        gain));
  }
  if (const double gain = gained_by_shift(views, metrics, settings); gain > kShiftDecibels) {
    out.push_back(fmt::format(
        "Held-out photos are {:.1f} dB nearer to the model once each is shifted, by {:.1f} pixels "
        "in the median, as where poses are inexact: try --poses",
        gain, usual_shift(views)));
  }
  warn_of_views(views, metrics, settings, out);
  return out;
}

}  // namespace raysplats::report
