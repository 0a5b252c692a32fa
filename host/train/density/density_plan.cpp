// SPDX-License-Identifier: Apache-2.0
#include "train/density/density_plan.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "scene/gaussians/activation.hpp"
#include "scene/morton_order.hpp"

namespace raysplats {
namespace {

enum class Fate : std::uint8_t { kKeep, kClone, kSplit, kHalve, kPrune };

struct Candidate {
  float score;
  std::uint32_t index;
};

double size_of(const float* parameters, const DensityRules& rules) {
  double longest = 0, squares = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double parameter = parameters[axis];
    const double size =
        rules.activation == ScaleActivation::kExp ? std::exp(parameter) : sigmoid(parameter);
    longest = std::max(longest, size);
    squares += size * size;
  }
  return rules.measure == SizeMeasure::kNorm ? std::sqrt(squares) : longest;
}

// The first `room` candidates by score; the others keep their fate.
void choose(std::vector<Candidate>& candidates,
            std::size_t room,
            std::vector<Fate>& fates,
            DensityPlan& plan) {
  if (candidates.size() <= room) return;
  const auto last = candidates.begin() + static_cast<std::ptrdiff_t>(room);
  std::nth_element(candidates.begin(), last, candidates.end(),
                   [](const Candidate& a, const Candidate& b) {
                     return a.score != b.score ? a.score > b.score : a.index < b.index;
                   });
  plan.refused = candidates.size() - room;
  for (std::size_t k = room; k < candidates.size(); ++k) fates[candidates[k].index] = Fate::kKeep;
  candidates.resize(room);
}

// Writes the new set along the Morton curve of the means.
void arrange(std::span<const float> means, const std::vector<Fate>& fates, DensityPlan& plan) {
  const auto add = [&plan](std::uint32_t index, DensityRole role) {
    plan.source.push_back(index);
    plan.role.push_back(static_cast<std::uint32_t>(role));
  };
  for (const std::uint32_t i : morton_order(means)) {
    switch (fates[i]) {
      case Fate::kPrune:
        break;
      case Fate::kKeep:
        add(i, DensityRole::kKeep);
        break;
      case Fate::kClone:
        add(i, DensityRole::kKeep);
        add(i, DensityRole::kClone);
        ++plan.cloned;
        break;
      case Fate::kSplit:
        add(i, DensityRole::kFirstChild);
        add(i, DensityRole::kSecondChild);
        ++plan.split;
        break;
      case Fate::kHalve:
        add(i, DensityRole::kFirstHalf);
        add(i, DensityRole::kSecondHalf);
        ++plan.split;
        break;
    }
  }
}

// The first reason that all rules know for removing Gaussian i; null for none.
template <class Rules>
std::size_t* reason_of(DensityPlan& plan,
                       std::span<const float> means,
                       std::span<const float> scales,
                       std::span<const float> opacities,
                       const Rules& rules,
                       std::size_t i) {
  return !is_finite(means, scales, opacities, i)         ? &plan.not_finite
         : is_outside(rules.bounds, means, i)            ? &plan.outside
         : !(sigmoid(opacities[i]) >= rules.min_opacity) ? &plan.faint
                                                         : nullptr;
}

// Removes and counts the Gaussian that there is a reason for; false without one.
bool prunes(std::size_t* reason, Fate& fate, DensityPlan& plan) {
  if (reason == nullptr) return false;
  fate = Fate::kPrune;
  ++*reason;
  ++plan.pruned;
  return true;
}

// Each candidate that there is room for below `target` adds one to what is left.
void finish(DensityPlan& plan,
            std::vector<Candidate>& candidates,
            std::size_t target,
            std::span<const float> means,
            std::vector<Fate>& fates) {
  const std::size_t survivors = fates.size() - plan.pruned;
  choose(candidates, target > survivors ? target - survivors : 0, fates, plan);
  arrange(means, fates, plan);
}

}  // namespace

// A sum is finite when all of its terms are.
bool is_finite(std::span<const float> means,
               std::span<const float> scales,
               std::span<const float> opacities,
               std::size_t i) {
  return std::isfinite(means[3 * i] + means[3 * i + 1] + means[3 * i + 2] + scales[3 * i] +
                       scales[3 * i + 1] + scales[3 * i + 2] + opacities[i]);
}

bool is_outside(const std::optional<Bounds>& bounds, std::span<const float> means, std::size_t i) {
  return bounds && !bounds->contains(means[3 * i], means[3 * i + 1], means[3 * i + 2]);
}

std::vector<std::uint32_t> DensityPlan::state_source() const {
  std::vector<std::uint32_t> out(source);
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (role[i] != static_cast<std::uint32_t>(DensityRole::kKeep)) out[i] = RS_NO_SOURCE;
  }
  return out;
}

std::string DensityPlan::remedy() const {
  const std::array<std::pair<std::size_t, const char*>, 7> reasons{
      {{outside, "most are outside of --bounds: give a larger box"},
       {faint,
        "most are too faint: lower --prune-opacity or --opacity-lr, or raise --init-opacity"},
       {large, "most are too large: raise --prune-scale, or set it to 0"},
       {small, "most are too small: lower --prune-scale-min"},
       {unseen, "no view meets most of them: see whether cameras and points belong together"},
       {hardly_seen, "rays blend too little of most of them: lower --prune-weight, or set it to 0"},
       {not_finite, "most are not finite: lower the learning rates"}}};
  return std::max_element(reasons.begin(), reasons.end(),
                          [](const auto& a, const auto& b) { return a.first < b.first; })
      ->second;
}

DensityPlan plan_density(std::span<const float> means,
                         std::span<const float> scales,
                         std::span<const float> opacities,
                         std::span<const float> statistics,
                         const DensityRules& rules) {
  const std::size_t count = opacities.size();
  DensityPlan plan;
  std::vector<Fate> fates(count, Fate::kKeep);
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < count; ++i) {
    const double size = size_of(&scales[3 * i], rules);
    std::size_t* reason = reason_of(plan, means, scales, opacities, rules, i);
    if (reason == nullptr) {
      reason = !(rules.max_size <= 0 || size <= rules.max_size)   ? &plan.large
               : !(rules.min_size <= 0 || size >= rules.min_size) ? &plan.small
                                                                  : nullptr;
    }
    if (prunes(reason, fates[i], plan)) continue;
    const float* seen = &statistics[kDensityStatistics * i];
    const float views = seen[1], score = views > 0 ? seen[0] / views : 0.0f;
    if (views > 0 && score >= rules.gradient) {
      candidates.push_back({score, static_cast<std::uint32_t>(i)});
      fates[i] = size > rules.split_size ? Fate::kSplit : Fate::kClone;
    }
  }
  finish(plan, candidates, rules.max_count, means, fates);
  return plan;
}

DensityPlan plan_budget(std::span<const float> means,
                        std::span<const float> scales,
                        std::span<const float> opacities,
                        std::span<const float> statistics,
                        const BudgetRules& rules) {
  const std::size_t count = opacities.size();
  DensityPlan plan;
  std::vector<Fate> fates(count, Fate::kKeep);
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < count; ++i) {
    const float* seen = &statistics[kDensityStatistics * i];
    const float signal = seen[0], views = seen[1], beyond = seen[2];
    std::size_t* reason = reason_of(plan, means, scales, opacities, rules, i);
    if (reason == nullptr && rules.remove_unseen && !(views > 0)) reason = &plan.unseen;
    if (reason == nullptr && rules.remove_hardly_seen && beyond < 0) reason = &plan.hardly_seen;
    if (prunes(reason, fates[i], plan)) continue;
    if (views > 0 && signal > 0) {
      candidates.push_back({signal / views, static_cast<std::uint32_t>(i)});
      fates[i] = Fate::kHalve;
    }
  }
  finish(plan, candidates, rules.target, means, fates);
  return plan;
}

}  // namespace raysplats
