// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "raysplats/trace_options.hpp"
#include "raysplats/train_options.hpp"
#include "shared/train_layout.h"

namespace raysplats {

/// What becomes of a Gaussian in the new set.
enum class DensityRole : std::uint32_t {
  kKeep = RS_ROLE_KEEP,
  kClone = RS_ROLE_CLONE,
  kFirstChild = RS_ROLE_FIRST_CHILD,
  kSecondChild = RS_ROLE_SECOND_CHILD,
  kFirstHalf = RS_ROLE_FIRST_HALF,
  kSecondHalf = RS_ROLE_SECOND_HALF,
  kPart = RS_ROLE_PART,  ///< of 3DGS-MCMC; what it shares with the others follows (apply_shares())
};

/// Numbers per Gaussian of the statistics that density control sums over views: the signal, how
/// many views saw it, by how much their rays blend more of it than prune-weight.
inline constexpr std::size_t kDensityStatistics = 3;

/// Thresholds of one pass of density control, in world units.
struct DensityRules {
  double gradient = 0;     ///< densify at and above this mean signal
  double split_size = 0;   ///< size above which a candidate is split, else cloned
  double min_opacity = 0;  ///< remove below
  double max_size = 0;     ///< remove above; 0 = off
  double min_size = 0;     ///< remove below; 0 = off
  SizeMeasure measure = SizeMeasure::kLongest;  ///< of all sizes
  std::size_t max_count = 0;
  ScaleActivation activation = ScaleActivation::kExp;
  std::optional<Bounds> bounds;  ///< remove outside
};

/// Rules of one pass that keeps to a number of Gaussians.
struct BudgetRules {
  std::size_t target = 0;      ///< Gaussians after the pass; fewer when there are no candidates
  double min_opacity = 0;      ///< remove below
  bool remove_unseen = false;  ///< remove what no ray of any view met
  bool remove_hardly_seen = false;  ///< and what their rays blend too little of
  std::optional<Bounds> bounds;     ///< remove outside
};

/// The new set of Gaussians: entry i comes from source[i] in the role role[i]; ordered along the
/// Morton curve of the sources' means.
struct DensityPlan {
  std::vector<std::uint32_t> source;
  std::vector<std::uint32_t> role;  ///< DensityRole
  std::size_t cloned = 0;
  std::size_t split = 0;
  std::size_t pruned = 0;
  /// Of the pruned, by the first of these that holds.
  std::size_t not_finite = 0, outside = 0, faint = 0, large = 0, small = 0, unseen = 0,
              hardly_seen = 0;
  std::size_t refused = 0;  ///< candidates left as they are because of max_count
  /// source[i] where i keeps its state, RS_NO_SOURCE where it is new.
  std::vector<std::uint32_t> state_source() const;
  bool changes() const { return cloned + split + pruned > 0; }
  /// What the user can do when too many are pruned: about the most frequent reason.
  std::string remedy() const;
};

/// Whether all parameters of Gaussian i that plans read are finite.
bool is_finite(std::span<const float> means,
               std::span<const float> scales,
               std::span<const float> opacities,
               std::size_t i);
/// Whether the mean of Gaussian i lies outside of the box, if there is one.
bool is_outside(const std::optional<Bounds>& bounds, std::span<const float> means, std::size_t i);

/// Decides from host copies of the parameters (means 3 N, scales 3 N and opacities N before
/// activation) and of the statistics (kDensityStatistics N). A Gaussian that is
/// removed is no candidate; one with a parameter that is not finite is removed. Each candidate adds
/// one Gaussian; under the cap the highest mean signals win, ties the lower index. Memory O(N),
/// time O(N log N).
DensityPlan plan_density(std::span<const float> means,
                         std::span<const float> scales,
                         std::span<const float> opacities,
                         std::span<const float> statistics,
                         const DensityRules& rules);

/// Decides by rank: removes what is transparent, not finite, unseen or hardly seen, and splits the
/// Gaussians with the highest mean signals along their longest axis until there are `target` (ties:
/// the lower index). A Gaussian is split once in a pass at most. Arguments, memory and time as
/// plan_density().
DensityPlan plan_budget(std::span<const float> means,
                        std::span<const float> scales,
                        std::span<const float> opacities,
                        std::span<const float> statistics,
                        const BudgetRules& rules);

}  // namespace raysplats
