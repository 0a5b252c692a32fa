// SPDX-License-Identifier: Apache-2.0
#include "scene/gaussians/quantization.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "util/parallel.hpp"
#include "util/rng.hpp"
#include "util/stop_if_interrupted.hpp"

namespace raysplats {
namespace {

/// Edges of the histogram: half of them even in value, half in rank.
constexpr std::size_t kEdges = 2048;
constexpr int kLevelRounds = 4;
constexpr int kRounds = 8;
/// Vectors of the sample that cells of space are found on, for each cell.
constexpr std::size_t kSample = 128;
/// Vectors that a thread takes at once.
constexpr std::size_t kChunk = 1024;

/// Sums over the first values, for errors of ranges.
struct Sums {
  std::vector<double> count{0.0}, sum{0.0}, square{0.0};

  void add(double value) {
    count.push_back(count.back() + 1.0);
    sum.push_back(sum.back() + value);
    square.push_back(square.back() + value * value);
  }
  double mean(std::size_t i, std::size_t j) const {
    return (sum[j] - sum[i]) / (count[j] - count[i]);
  }
  /// Squared error of values i to j around their mean.
  double error(std::size_t i, std::size_t j) const {
    if (j <= i) return 0.0;
    const double total = sum[j] - sum[i];
    return square[j] - square[i] - total * total / (count[j] - count[i]);
  }
};

/// Ends of the bins among sorted values, rising, without empty bins.
std::vector<std::size_t> bin_ends(const std::vector<float>& sorted) {
  std::vector<std::size_t> ends;
  const double low = static_cast<double>(sorted.front());
  const double range = static_cast<double>(sorted.back()) - low;
  for (std::size_t k = 1; k <= kEdges; ++k) {
    const double part = static_cast<double>(k) / static_cast<double>(kEdges);
    const auto edge = static_cast<float>(low + range * part);
    ends.push_back(static_cast<std::size_t>(std::upper_bound(sorted.begin(), sorted.end(), edge) -
                                            sorted.begin()));
    ends.push_back(static_cast<std::size_t>(part * static_cast<double>(sorted.size())));
  }
  ends.push_back(sorted.size());
  std::sort(ends.begin(), ends.end());
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  if (ends.front() == 0) ends.erase(ends.begin());
  return ends;
}

/// Where the best partition of bins into `levels` ranges cuts the values.
std::vector<std::size_t> best_cuts(const Sums& sums,
                                   const std::vector<std::size_t>& ends,
                                   std::size_t levels) {
  const std::size_t bins = ends.size();
  const auto at = [&](std::size_t bin) { return bin == 0 ? 0 : ends[bin - 1]; };
  std::vector<double> before(bins + 1, std::numeric_limits<double>::infinity()), now(bins + 1);
  before[0] = 0.0;
  std::vector<std::vector<std::uint32_t>> cuts;
  for (std::size_t level = 0; level < levels; ++level) {
    std::vector<std::uint32_t> cut(bins + 1, 0);
    std::fill(now.begin(), now.end(), std::numeric_limits<double>::infinity());
    now[0] = 0.0;
    // The best cut of a longer part does not lie before that of a shorter one.
    const std::function<void(std::size_t, std::size_t, std::size_t, std::size_t)> halve =
        [&](std::size_t first, std::size_t last, std::size_t from, std::size_t to) {
          if (first > last) return;
          const std::size_t middle = (first + last) / 2;
          std::size_t best = from;
          for (std::size_t i = from; i <= std::min(to, middle); ++i) {
            const double error = before[i] + sums.error(at(i), at(middle));
            if (error < now[middle]) {
              now[middle] = error;
              best = i;
            }
          }
          cut[middle] = static_cast<std::uint32_t>(best);
          if (middle > first) halve(first, middle - 1, from, best);
          halve(middle + 1, last, best, to);
        };
    halve(1, bins, 0, bins);
    cuts.push_back(std::move(cut));
    std::swap(before, now);
  }
  std::vector<std::size_t> out;
  std::size_t bin = bins;
  for (std::size_t level = levels; level-- > 0 && bin > 0;) {
    bin = cuts[level][bin];
    if (bin > 0) out.push_back(at(bin));
  }
  std::reverse(out.begin(), out.end());
  return out;
}

/// k-means over some of many vectors.
class Clusters {
 public:
  Clusters(std::span<const float> vectors, std::size_t width) : vectors_(vectors), width_(width) {}

  /// Finds `count` middles of the vectors `members`, starting from `count` of them.
  void fit(std::span<const std::uint32_t> members, std::size_t count, std::uint64_t seed) {
    count_ = count;
    middles_.resize(width_ * count);
    // Of a shuffled list the first are a sample without repeats.
    std::vector<std::uint32_t> shuffled(members.begin(), members.end());
    CounterRng random(seed, 0);
    for (std::size_t i = 0; i < count; ++i) {
      std::swap(shuffled[i], shuffled[i + random.below(shuffled.size() - i)]);
      for (std::size_t d = 0; d < width_; ++d) middles_[d * count + i] = part(shuffled[i], d);
    }
    std::vector<std::uint32_t> labels(members.size());
    for (int round = 0; round < kRounds; ++round) {
      label(members, labels);
      if (!move(members, labels)) return;
    }
  }

  /// The nearest middle of each of `members`.
  void label(std::span<const std::uint32_t> members, std::span<std::uint32_t> labels) const {
    stop_if_interrupted();
    std::vector<float> norms(count_, 0.0f);
    for (std::size_t d = 0; d < width_; ++d) {
      for (std::size_t k = 0; k < count_; ++k)
        norms[k] += middles_[d * count_ + k] * middles_[d * count_ + k];
    }
    const auto work = [&](std::size_t begin, std::size_t end) {
      std::vector<float> distance(count_);
      for (std::size_t i = begin; i < end; ++i) {
        // Squared distance without the part that all middles share.
        distance = norms;
        for (std::size_t d = 0; d < width_; ++d) {
          const float x = -2.0f * part(members[i], d);
          const float* row = &middles_[d * count_];
          for (std::size_t k = 0; k < count_; ++k) distance[k] += x * row[k];
        }
        labels[i] = static_cast<std::uint32_t>(std::min_element(distance.begin(), distance.end()) -
                                               distance.begin());
      }
    };
    if (members.size() * count_ < kChunk * kChunk) {
      work(0, members.size());
    } else {
      in_chunks(members.size(), kChunk, work);
    }
  }

  float middle(std::size_t cluster, std::size_t d) const { return middles_[d * count_ + cluster]; }
  float part(std::uint32_t vector, std::size_t d) const { return vectors_[vector * width_ + d]; }

 private:
  /// Moves middles to the means of their vectors; false when none moves. What has none stays.
  bool move(std::span<const std::uint32_t> members, std::span<const std::uint32_t> labels) {
    std::vector<double> sums(width_ * count_, 0.0);
    std::vector<double> sizes(count_, 0.0);
    for (std::size_t i = 0; i < members.size(); ++i) {
      sizes[labels[i]] += 1.0;
      for (std::size_t d = 0; d < width_; ++d)
        sums[labels[i] * width_ + d] += static_cast<double>(part(members[i], d));
    }
    bool moved = false;
    for (std::size_t k = 0; k < count_; ++k) {
      if (sizes[k] == 0.0) continue;
      for (std::size_t d = 0; d < width_; ++d) {
        const auto mean = static_cast<float>(sums[k * width_ + d] / sizes[k]);
        moved = moved || mean != middles_[d * count_ + k];
        middles_[d * count_ + k] = mean;
      }
    }
    return moved;
  }

  std::span<const float> vectors_;
  std::size_t width_;
  std::size_t count_ = 0;
  std::vector<float> middles_;  // a row for each number, so that lanes take clusters
};

/// All vectors that differ, in the order in which they come first; nothing for more than `most`.
std::optional<VectorPalette> distinct_vectors(std::span<const float> vectors,
                                              std::size_t width,
                                              std::size_t most) {
  const std::size_t count = vectors.size() / width;
  const auto vector = [&](std::uint32_t i) { return vectors.subspan(i * width, width); };
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const auto [x, y] = std::ranges::mismatch(vector(a), vector(b));
    return x == vector(a).end() ? a < b : *x < *y;
  });
  // Of equal ones the first to come stands for all.
  std::vector<std::uint32_t> first(count);
  for (std::size_t k = 0; k < count; ++k) {
    const bool again = k > 0 && std::ranges::equal(vector(order[k]), vector(order[k - 1]));
    first[order[k]] = again ? first[order[k - 1]] : order[k];
  }
  VectorPalette out;
  out.labels.resize(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (first[i] == i) {
      if (out.entries.size() == most * width) return std::nullopt;
      out.labels[i] = static_cast<std::uint32_t>(out.entries.size() / width);
      out.entries.insert(out.entries.end(), vector(i).begin(), vector(i).end());
    } else {
      out.labels[i] = out.labels[first[i]];
    }
  }
  return out;
}

/// How many of `most` entries each cell gets: in proportion to its spread, at least one, at most as
/// many as it has vectors.
std::vector<std::size_t> shares(const std::vector<double>& spreads,
                                const std::vector<std::vector<std::uint32_t>>& cells,
                                std::size_t most) {
  std::vector<std::size_t> out(cells.size(), 0);
  std::size_t left = most;
  double spread_left = 0.0;
  std::vector<std::size_t> order;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    if (cells[c].empty()) continue;
    order.push_back(c);
    spread_left += spreads[c];
  }
  // Cells that can use the least of their share come first, so that others get the rest.
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return static_cast<double>(cells[a].size()) * spreads[b] <
           static_cast<double>(cells[b].size()) * spreads[a];
  });
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::size_t c = order[i];
    const std::size_t others = order.size() - i - 1;  // each of which needs one
    const double fair =
        spread_left > 0.0 ? static_cast<double>(left) * spreads[c] / spread_left : 1.0;
    // Equal vectors need no more than one.
    const std::size_t high = spreads[c] > 0.0 ? std::min(cells[c].size(), left - others) : 1;
    out[c] = std::clamp<std::size_t>(static_cast<std::size_t>(fair), 1, high);
    left -= out[c];
    spread_left -= spreads[c];
  }
  return out;
}

}  // namespace

std::vector<float> best_levels(std::span<const float> values, std::size_t levels) {
  std::vector<float> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  std::vector<float> distinct = sorted;
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  if (distinct.size() <= levels) return distinct;
  Sums sums;
  for (const float value : sorted) sums.add(static_cast<double>(value));
  std::vector<std::size_t> cuts = best_cuts(sums, bin_ends(sorted), levels);
  std::vector<float> out;
  for (int round = 0;; ++round) {
    out.clear();
    std::size_t begin = 0;
    cuts.push_back(sorted.size());
    for (const std::size_t end : cuts) {
      if (end > begin) out.push_back(static_cast<float>(sums.mean(begin, end)));
      begin = std::max(begin, end);
    }
    if (round == kLevelRounds) return out;
    cuts.clear();
    for (std::size_t k = 0; k + 1 < out.size(); ++k) {
      const float middle = out[k] + (out[k + 1] - out[k]) / 2.0f;
      cuts.push_back(static_cast<std::size_t>(
          std::upper_bound(sorted.begin(), sorted.end(), middle) - sorted.begin()));
    }
  }
}

std::size_t nearest_level(std::span<const float> levels, float value) {
  const auto above = std::lower_bound(levels.begin(), levels.end(), value);
  if (above == levels.begin()) return 0;
  const auto index = static_cast<std::size_t>(above - levels.begin());
  if (above == levels.end()) return index - 1;
  return value - levels[index - 1] <= levels[index] - value ? index - 1 : index;
}

VectorPalette vector_palette(std::span<const float> vectors, std::size_t width, std::size_t most) {
  const std::size_t count = vectors.size() / width;
  if (auto distinct = distinct_vectors(vectors, width, most)) return *std::move(distinct);
  VectorPalette palette;
  palette.labels.resize(count);
  std::iota(palette.labels.begin(), palette.labels.end(), 0u);
  const std::vector<std::uint32_t> all = palette.labels;
  const auto cell_count = static_cast<std::size_t>(std::sqrt(static_cast<double>(most)));
  std::vector<std::uint32_t> sample;
  CounterRng random(1, 0);
  for (std::size_t i = 0; i < std::min(count, kSample * cell_count); ++i)
    sample.push_back(static_cast<std::uint32_t>(random.below(count)));
  std::sort(sample.begin(), sample.end());
  sample.erase(std::unique(sample.begin(), sample.end()), sample.end());
  Clusters coarse(vectors, width);
  coarse.fit(sample, std::min(cell_count, sample.size()), 2);
  coarse.label(all, palette.labels);

  std::vector<std::vector<std::uint32_t>> cells(cell_count);
  std::vector<double> spreads(cell_count, 0.0);
  for (const std::uint32_t i : all) {
    const std::uint32_t c = palette.labels[i];
    double square = 0.0;
    for (std::size_t d = 0; d < width; ++d) {
      const double away = static_cast<double>(coarse.part(i, d) - coarse.middle(c, d));
      square += away * away;
    }
    cells[c].push_back(i);
    spreads[c] += std::sqrt(square);
  }
  const std::vector<std::size_t> sizes = shares(spreads, cells, most);
  std::vector<std::uint32_t> labels;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    if (cells[c].empty()) continue;
    const auto first = static_cast<std::uint32_t>(palette.entries.size() / width);
    Clusters fine(vectors, width);
    fine.fit(cells[c], sizes[c], 3 + c);
    labels.resize(cells[c].size());
    fine.label(cells[c], labels);
    for (std::size_t i = 0; i < cells[c].size(); ++i)
      palette.labels[cells[c][i]] = first + labels[i];
    for (std::size_t k = 0; k < sizes[c]; ++k) {
      for (std::size_t d = 0; d < width; ++d) palette.entries.push_back(fine.middle(k, d));
    }
  }
  return palette;
}

}  // namespace raysplats
