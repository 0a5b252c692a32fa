// SPDX-License-Identifier: Apache-2.0
#include "train/schedule.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <set>
#include <utility>

#include "util/rng.hpp"

namespace raysplats {
namespace {

constexpr std::uint64_t kViewStream = 0x7669657773;
constexpr std::uint64_t kBackgroundStream = 0x6261636b;
constexpr std::uint64_t kJoinedPass = std::uint64_t{1} << 48;  // of passes over all views
constexpr std::uint64_t kShorterPass = std::uint64_t{1}
                                       << 50;  // of those over what is left of them
constexpr double kValidationShare = 0.9;  // of the run; then validation views are trained on too
constexpr int kValidations = 9;
constexpr std::int64_t kNeverJoined = 1LL << 52;  // beyond any run; its views can be counted
constexpr double kTimedShare = 0.05;  // of a run, once its steps are alike, that is timed

// Flat Gaussians: they find their shortest axis while they are round, and lose it from one share of
// the run to the other, at last to so much of the next one.
constexpr double kFlatFrom = 0.4, kFlatUntil = 0.8;
constexpr double kFlatness = 0.01;

// What a rate is in a run of 1000 iterations, and between what it stays in others.
struct FittedRate {
  double usual;
  double least;
  double most;
};

constexpr double kFittedIterations = 1000;
constexpr FittedRate kPositionFinalRate{1e-5, 5e-6, 2e-5};
constexpr FittedRate kRotationFinalRate{0.003, 0.001, 0.003};
constexpr FittedRate kScaleRate{0.08, 0.04, 0.12};
constexpr FittedRate kScaleFinalRate{0.01, 0.005, 0.02};
constexpr FittedRate kOpacityFinalRate{0.06, 0.03, 0.1};
constexpr FittedRate kShFinalRate{0.005, 0.0025, 0.01};
constexpr FittedRate kShRestRate{0.003, 0.0005, 0.003};
constexpr FittedRate kShRestFinalRate{0.001, 0.000125, 0.001};

constexpr double kUsualColorRange = 0.8;  // below, photos lack contrast

// Completed iterations at which validation views are looked at, the first to the kValidations-th.
std::int64_t validation_at(const TrainOptions& options, int number) {
  const double share = kValidationShare * number / kValidations;
  return std::llround(share * static_cast<double>(options.iterations));
}

// By the root of the number of steps, as far as a walk of that many steps leads.
double fitted(const FittedRate& rate, const TrainOptions& options) {
  const auto steps = static_cast<double>(std::max<std::int64_t>(options.iterations, 1));
  return std::clamp(rate.usual * std::sqrt(kFittedIterations / steps), rate.least, rate.most);
}

// A rate that begins with `start` where nothing else is given, but not below a given final one.
LearningRate with_start(LearningRate rate, double start) {
  if (rate.initial == kFitted) rate.initial = std::max(start, rate.final_value);
  return rate;
}

// A rate whose initial value is known: it never rises to a final one that is fitted.
LearningRate with_end(LearningRate rate, const FittedRate& end, const TrainOptions& options) {
  if (rate.final_value == kFitted) rate.final_value = std::min(fitted(end, options), rate.initial);
  return rate;
}

// Fewer photos are known by heart sooner: from then on a model gets worse between them.
constexpr std::int64_t kPasses = 100;
constexpr std::int64_t kShortestFitted = 1000, kLongestFitted = 10000;
constexpr double kUsualDecay = 0.01;  // after twice as many

}  // namespace

std::int64_t usual_length(std::size_t photos) {
  return std::clamp(kPasses * static_cast<std::int64_t>(photos), kShortestFitted, kLongestFitted);
}

std::int64_t run_length(const TrainOptions& options, std::size_t photos) {
  return options.iterations != kFittedLength ? options.iterations : usual_length(photos);
}

bool clears_random_start(const TrainOptions& options) {
  return options.init == "random" && options.strategy != DensityStrategy::kMcmc;
}

LearningRate rotation_rate(const TrainOptions& options) {
  return with_end(options.rotation_lr, kRotationFinalRate, options);
}

LearningRate scale_rate(const TrainOptions& options) {
  const double start = fitted(kScaleRate, options);
  return with_end(with_start(options.scale_lr, start), kScaleFinalRate, options);
}

LearningRate opacity_rate(const TrainOptions& options) {
  return with_end(options.opacity_lr, kOpacityFinalRate, options);
}

LearningRate sh_rate(const TrainOptions& options) {
  return with_end(options.sh_lr, kShFinalRate, options);
}

LearningRate sh_rest_rate(const TrainOptions& options) {
  const double start = fitted(kShRestRate, options);
  return with_end(with_start(options.sh_rest_lr, start), kShRestFinalRate, options);
}

double color_share(const TrainOptions& options) {
  return options.color_range > 0 ? std::min(options.color_range / kUsualColorRange, 1.0) : 1.0;
}

LearningRate position_rate(const TrainOptions& options) {
  const double start = clears_random_start(options) ? 2e-3 : 5e-4;
  return with_end(with_start(options.position_lr, start), kPositionFinalRate, options);
}

double start_opacity(const TrainOptions& options) {
  if (options.init_opacity != kFitted) return options.init_opacity;
  return clears_random_start(options) ? 0.02 : 0.1;
}

std::int64_t pass_steps(std::int64_t views, std::int64_t together) {
  return (views + together - 1) / together;
}

bool shows_all(std::int64_t steps, std::int64_t views, std::int64_t together) {
  return steps * together % views == 0 || steps * together >= 2 * views - 1;
}

double pass_decay(const TrainOptions& options, std::int64_t pass) {
  if (options.opacity_decay != kFitted) return options.opacity_decay;
  if (clears_random_start(options)) return kUsualDecay;
  const double passes = static_cast<double>(options.iterations) / static_cast<double>(pass);
  return kUsualDecay * std::clamp(passes / static_cast<double>(kPasses) - 1.0, 0.0, 1.0);
}

double learning_rate(const LearningRate& rate,
                     const TrainOptions& options,
                     std::int64_t iteration) {
  if (rate.initial <= 0) return 0.0;
  if (options.lr_decay > 0) {
    const double decayed =
        rate.initial * std::exp(-options.lr_decay * static_cast<double>(iteration));
    return rate.final_value < rate.initial ? std::max(decayed, rate.final_value) : rate.initial;
  }
  const auto last = static_cast<double>(std::max<std::int64_t>(options.iterations - 1, 1));
  const double share = std::min(static_cast<double>(iteration) / last, 1.0);
  return rate.initial * std::pow(rate.final_value / rate.initial, share);
}

double flat_thickness(const TrainOptions& options, std::int64_t iteration) {
  if (!options.flat) return 1;
  const double share = static_cast<double>(iteration + 1) / static_cast<double>(options.iterations);
  return std::pow(kFlatness, std::clamp((share - kFlatFrom) / (kFlatUntil - kFlatFrom), 0.0, 1.0));
}

int active_sh_degree(const TrainOptions& options, std::int64_t iteration) {
  const std::int64_t interval = options.sh_degree_interval.of(options.iterations);
  if (interval == 0) return options.sh_degree;
  return static_cast<int>(std::min<std::int64_t>(options.sh_degree, iteration / interval));
}

int resolution_divisor(const TrainOptions& options, std::int64_t iteration) {
  for (const ResolutionStep& step : options.resolution_schedule) {
    if (iteration < step.until.of(options.iterations)) return step.divisor;
  }
  return 1;
}

std::int64_t last_iteration(const TrainOptions& options) {
  return options.end_iteration > 0 ? options.end_iteration : options.iterations;
}

std::int64_t steady_from(const TrainOptions& options) {
  std::int64_t from =
      std::max({std::int64_t{1}, options.densify_until.of(options.iterations),
                options.sh_degree * options.sh_degree_interval.of(options.iterations)});
  for (const ResolutionStep& step : options.resolution_schedule)
    from = std::max(from, step.until.of(options.iterations));
  if (options.flat) from = std::max(from, RunShare(kFlatUntil).of(options.iterations));
  return from;
}

std::int64_t timed_until(const TrainOptions& options) {
  return steady_from(options) + std::llround(kTimedShare * static_cast<double>(options.iterations));
}

std::int64_t mean_from(const TrainOptions& options) {
  if (options.average_from.value == 0) return std::numeric_limits<std::int64_t>::max();
  return std::max(options.average_from.of(last_iteration(options)), timed_until(options));
}

std::array<float, 3> step_background(const TrainOptions& options,
                                     bool cut_out,
                                     const std::array<float, 3>& constant,
                                     std::int64_t iteration) {
  if (options.background != "random") return constant;
  if (!cut_out) return {0.0f, 0.0f, 0.0f};
  CounterRng rng(options.seed, kBackgroundStream, 3 * static_cast<std::uint64_t>(iteration));
  std::array<float, 3> color{};
  for (float& channel : color) channel = static_cast<float>(rng.uniform());
  return color;
}

std::int64_t validation_end(const TrainOptions& options) {
  return std::llround(kValidationShare * static_cast<double>(options.iterations));
}

std::int64_t validation_join(const TrainOptions& options) {
  return options.poses ? kNeverJoined : validation_end(options);
}

bool validates_at(const TrainOptions& options, std::int64_t iteration) {
  if (options.validate_views == 0 || iteration > validation_end(options)) return false;
  for (int number = 1; number <= kValidations; ++number) {
    if (validation_at(options, number) == iteration) return true;
  }
  return false;
}

std::size_t evaluation_count(const TrainOptions& options) {
  const std::int64_t last = last_iteration(options);
  std::set<std::int64_t> single;
  for (const RunShare& share : options.eval_at) {
    const std::int64_t at = share.of(options.iterations);
    if (at > 0 && at < last) single.insert(at);
  }
  if (options.eval_every == 0 || last == 0) return single.size() + 1;
  std::erase_if(single, [&](std::int64_t at) { return at % options.eval_every == 0; });
  return single.size() + static_cast<std::size_t>((last - 1) / options.eval_every) + 1;
}

std::size_t validation_count(const TrainOptions& options) {
  if (options.validate_views == 0) return 0;
  std::set<std::int64_t> all;
  for (int number = 1; number <= kValidations; ++number) {
    const std::int64_t at = validation_at(options, number);
    if (at > 0 && at <= last_iteration(options)) all.insert(at);
  }
  return all.size();
}

std::vector<std::size_t> validation_views(std::size_t views, int count) {
  const std::size_t most = views > kLeastTrained ? views - kLeastTrained : 0;
  std::vector<std::size_t> out(std::min(static_cast<std::size_t>(std::max(count, 0)), most));
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = (2 * i + 1) * views / (2 * out.size());
  return out;
}

namespace {

// Of ascending numbers.
std::vector<std::size_t> without(std::span<const std::size_t> all,
                                 std::span<const std::size_t> some) {
  std::vector<std::size_t> out;
  std::set_difference(all.begin(), all.end(), some.begin(), some.end(), std::back_inserter(out));
  return out;
}

std::vector<std::size_t> in_both(std::span<const std::size_t> a, std::span<const std::size_t> b) {
  std::vector<std::size_t> out;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(out));
  return out;
}

// Steps of a run for each of its photos.
double visits(const TrainOptions& options, std::size_t photos) {
  return static_cast<double>(options.iterations) * options.views_per_step /
         std::max(1.0, static_cast<double>(photos));
}

bool is_at(std::span<const double> shares, std::int64_t iterations, std::int64_t iteration) {
  return std::any_of(shares.begin(), shares.end(), [&](double share) {
    return iteration == std::llround(share * static_cast<double>(iterations));
  });
}

}  // namespace

std::span<const double> judged_shares(const TrainOptions& options, std::size_t photos) {
  static constexpr std::array<double, 5> kOften{0.1, 0.2, 0.3, 0.4, 0.5};
  static constexpr std::array<double, 2> kTwice{0.2, 0.4};
  static constexpr std::array<double, 1> kOnce{0.3};
  if (!options.leave_out_odd || options.poses || photos == 0) return {};
  const double each = visits(options, photos);
  if (each >= 60) return kOften;
  if (each >= 15) return kTwice;
  if (each >= 6) return kOnce;
  return {};
}

bool judges_photos_at(const TrainOptions& options, std::size_t photos, std::int64_t iteration) {
  return is_at(judged_shares(options, photos), options.iterations, iteration);
}

std::span<const double> moving_shares(const TrainOptions& options, std::size_t photos) {
  static constexpr std::array<double, 4> kOften{0.2, 0.3, 0.4, 0.5};
  static constexpr std::array<double, 2> kTwice{0.2, 0.4};
  if (!options.leave_out_moving || photos == 0) return {};
  return visits(options, photos) >= 15 ? std::span<const double>(kOften) : kTwice;
}

bool looks_for_motion_at(const TrainOptions& options, std::size_t photos, std::int64_t iteration) {
  return is_at(moving_shares(options, photos), options.iterations, iteration);
}

ViewOrder::ViewOrder(std::uint64_t seed,
                     std::size_t views,
                     std::span<const std::size_t> apart,
                     std::int64_t join,
                     CrowdedPlaces crowded)
    : seed_(seed), crowded_(std::move(crowded)) {
  std::vector<std::size_t> all(views);
  std::iota(all.begin(), all.end(), std::size_t{0});
  parts_.push_back(part_of(0, kViewStream, without(all, apart)));
  if (!apart.empty()) parts_.push_back(part_of(join, kViewStream + kJoinedPass, std::move(all)));
}

ViewOrder::Part ViewOrder::part_of(std::int64_t from,
                                   std::uint64_t stream,
                                   std::vector<std::size_t> views) const {
  Part out{from, stream, std::move(views), 0};
  out.size = out.views.size();
  for (const CrowdedPlace& place : crowded_.places) {
    const std::size_t here = in_both(out.views, place.photos).size();
    out.size -= here - std::min(here, crowded_.most);
  }
  return out;
}

// The views of a pass, ascending.
std::vector<std::size_t> ViewOrder::drawn(const Part& part, CounterRng& rng) const {
  std::vector<std::size_t> out = part.views;
  for (const CrowdedPlace& place : crowded_.places) {
    std::vector<std::size_t> spare = in_both(part.views, place.photos);
    for (std::size_t i = 0; i < std::min(crowded_.most, spare.size()); ++i)
      std::swap(spare[i], spare[i + rng.below(spare.size() - i)]);
    spare.erase(spare.begin(),
                spare.begin() + static_cast<std::ptrdiff_t>(std::min(crowded_.most, spare.size())));
    std::sort(spare.begin(), spare.end());
    out = without(out, spare);
  }
  return out;
}

void ViewOrder::leave_out(std::span<const std::size_t> views, std::int64_t from) {
  std::vector<Part> parts;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    const std::int64_t end = i + 1 < parts_.size() ? parts_[i + 1].from : kNeverJoined;
    if (part.from < from) parts.push_back(part);
    if (end <= from) continue;
    parts.push_back(
        part_of(std::max(part.from, from), part.stream + kShorterPass, without(part.views, views)));
  }
  parts_ = std::move(parts);
}

std::size_t ViewOrder::at(std::int64_t iteration) {
  const auto after = std::find_if(parts_.begin() + 1, parts_.end(),
                                  [&](const Part& part) { return part.from > iteration; });
  const Part& part = *(after - 1);
  const auto size = static_cast<std::int64_t>(part.size);
  const std::int64_t since = iteration - part.from;
  const std::uint64_t stream = part.stream + static_cast<std::uint64_t>(since / size);
  if (permutation_.empty() || stream != stream_) {
    stream_ = stream;
    CounterRng rng(seed_, stream);
    permutation_ = drawn(part, rng);
    for (std::size_t i = permutation_.size(); i > 1; --i)
      std::swap(permutation_[i - 1], permutation_[rng.below(i)]);
  }
  position_ = static_cast<std::size_t>(since % size);
  return permutation_[position_];
}

std::span<const std::size_t> ViewOrder::upcoming(std::size_t count) const {
  const std::span<const std::size_t> all(permutation_);
  return all.subspan(position_ + 1, std::min(count, all.size() - position_ - 1));
}

}  // namespace raysplats
