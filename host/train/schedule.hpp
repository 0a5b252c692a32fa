// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "raysplats/train_options.hpp"
#include "train/crowded_places.hpp"
#include "util/rng.hpp"

namespace raysplats {

/// What changes with the iteration, as pure functions of it, so that a resumed run continues
/// exactly. Iterations are counted from 0: the first step of a run is iteration 0.

/// Iterations of a run on so many training photos that does not say how long it is to be: 100
/// passes over the photos, from 1000 to 10 000 iterations.
std::int64_t usual_length(std::size_t photos);
/// As the options give them, or the usual ones.
std::int64_t run_length(const TrainOptions& options, std::size_t photos);

/// Learning rate of a group. With lr-decay = d > 0: initial * exp(-d * iteration) until it meets
/// the final value; with 0: geometric interpolation that reaches the final value in the last
/// iteration, as in 3DGS.
double learning_rate(const LearningRate& rate, const TrainOptions& options, std::int64_t iteration);

/// Rates of the groups of parameters as they are given, with what the number of iterations asks
/// for in place of kFitted: short runs need large steps to their end, and what those do to a model
/// the mean of the last ones takes away.
LearningRate rotation_rate(const TrainOptions& options);
LearningRate scale_rate(const TrainOptions& options);
LearningRate opacity_rate(const TrainOptions& options);
LearningRate sh_rate(const TrainOptions& options);
LearningRate sh_rest_rate(const TrainOptions& options);

/// What rates of colours are multiplied by: photos of a small range (fog, night) are the same scene
/// in smaller numbers, and steps that do not shrink with them are noise there. 1 where the range is
/// usual, or not known yet.
double color_share(const TrainOptions& options);

/// Whether Gaussians begin at random places, where they stand in front of each other, have far to
/// go, and many are to go altogether. The mcmc strategy moves and revives them by itself.
bool clears_random_start(const TrainOptions& options);

/// The rate of the means (its end as above) and the opacity of the first Gaussians, as they are
/// given, with what the start asks for in place of kFitted.
LearningRate position_rate(const TrainOptions& options);
double start_opacity(const TrainOptions& options);

/// Steps of so many views `together` that show each of `views` once.
std::int64_t pass_steps(std::int64_t views, std::int64_t together);

/// Whether every stretch of so many steps, one behind the other from the first step on, shows each
/// of `views`, whose order is drawn anew for each pass over them: stretches of other lengths begin
/// within a pass and may end before what the next one shows last.
bool shows_all(std::int64_t steps, std::int64_t views, std::int64_t together);

/// What each refinement of density control takes off opacities, as given. In place of kFitted what
/// a random start asks for, or a run that is long for its photos: 0 up to 100 steps for each of
/// them, all from 200 on. `pass`: the steps that show every photo once, at least 1.
double pass_decay(const TrainOptions& options, std::int64_t pass);

/// What the shortest axis of a flat Gaussian may have of the next one after this step; 1 where all
/// are round.
double flat_thickness(const TrainOptions& options, std::int64_t iteration);

/// Degree of the SH bands that are switched on.
int active_sh_degree(const TrainOptions& options, std::int64_t iteration);

/// 2^k by which the image size is divided (resolution-schedule).
int resolution_divisor(const TrainOptions& options, std::int64_t iteration);

/// Iteration that the run ends with.
std::int64_t last_iteration(const TrainOptions& options);

/// The iteration, 1 at least, from which on steps are alike: photos have their full size, all SH
/// bands are on, the number of Gaussians no longer grows, and flat ones are flat.
std::int64_t steady_from(const TrainOptions& options);

/// Until when a run by time takes the time of such steps, which then tells when it will end.
std::int64_t timed_until(const TrainOptions& options);

/// Steps before those whose parameters are averaged: average-from of the run, but not before
/// timed_until(), so that runs by time and those that replay them average the same steps; a number
/// that no run reaches where the option is 0.
std::int64_t mean_from(const TrainOptions& options);

/// Background of a step: `constant` unless the option is "random" and the photos are cut out by
/// their alpha.
std::array<float, 3> step_background(const TrainOptions& options,
                                     bool cut_out,
                                     const std::array<float, 3>& constant,
                                     std::int64_t iteration);

/// Completed iterations after which the views of validate-views judge no more: 0.9 of the run.
std::int64_t validation_end(const TrainOptions& options);

/// Completed iterations after which these views join the others: validation_end(). Where poses are
/// trained a number that no run reaches: theirs would join untrained, when those of the others are
/// known, and harm the model.
std::int64_t validation_join(const TrainOptions& options);

/// Whether the validation views are looked at after `iteration` completed ones: every tenth of the
/// run, as long as they are kept apart.
bool validates_at(const TrainOptions& options, std::int64_t iteration);

/// Iterations of the run after which the test views are evaluated, the last one among them.
std::size_t evaluation_count(const TrainOptions& options);

/// Iterations of the run after which the validation views are looked at.
std::size_t validation_count(const TrainOptions& options);

/// Training views that validation leaves.
constexpr std::size_t kLeastTrained = 2;

/// `count` of `views` positions, evenly spread; fewer when that would leave less than two others.
std::vector<std::size_t> validation_views(std::size_t views, int count);

/// When it is judged which of `photos` contradict the others: shares of the run, ascending. A
/// comparison costs a third of a step for each photo, so that a run has more of them the more often
/// it shows each photo; none below six times, and none where poses are trained.
std::span<const double> judged_shares(const TrainOptions& options, std::size_t photos);
/// Whether that is after `iteration` completed ones.
bool judges_photos_at(const TrainOptions& options, std::size_t photos, std::int64_t iteration);

/// When it is looked for what moves in the photos, with the option: shares of the run, ascending.
/// Not before 0.2: what a model lacks that it would have learned until then is not to be taken for
/// something that moves.
std::span<const double> moving_shares(const TrainOptions& options, std::size_t photos);
/// Whether that is after `iteration` completed ones.
bool looks_for_motion_at(const TrainOptions& options, std::size_t photos, std::int64_t iteration);

/// Order in which views are trained: a new random permutation for every pass over them.
class ViewOrder {
 public:
  /// Of all positions in [0, views); those in `apart` (ascending) come in from iteration `join` on
  /// only, where a new pass begins. Of a crowded place every pass has as many as it is worth,
  /// others each time.
  ViewOrder(std::uint64_t seed,
            std::size_t views,
            std::span<const std::size_t> apart = {},
            std::int64_t join = 0,
            CrowdedPlaces crowded = {});
  /// Views (ascending) that no iteration from `from` on has, where a new pass begins; once.
  void leave_out(std::span<const std::size_t> views, std::int64_t from);
  /// Position in [0, views) of the view of an iteration.
  std::size_t at(std::int64_t iteration);
  /// The views of the iterations after the last one asked for, at most `count` and up to the end of
  /// the pass.
  std::span<const std::size_t> upcoming(std::size_t count) const;

 private:
  // Passes over the same views.
  struct Part {
    std::int64_t from;
    std::uint64_t stream;  // of random numbers of its first pass
    std::vector<std::size_t> views;
    std::size_t size;  // of a pass: fewer where places are crowded
  };

  Part part_of(std::int64_t from, std::uint64_t stream, std::vector<std::size_t> views) const;
  std::vector<std::size_t> drawn(const Part& part, CounterRng& rng) const;

  std::uint64_t seed_;
  CrowdedPlaces crowded_;
  std::vector<Part> parts_;   // in their order
  std::uint64_t stream_ = 0;  // of the pass that follows
  std::size_t position_ = 0;
  std::vector<std::size_t> permutation_;
};

}  // namespace raysplats
