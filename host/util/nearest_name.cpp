// SPDX-License-Identifier: Apache-2.0
#include "util/nearest_name.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>

namespace raysplats {
namespace {

constexpr std::size_t kFew = 12;  // names that a message lists

std::size_t levenshtein(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row[b.size()];
}

}  // namespace

std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates) {
  std::string best;
  const std::size_t dashes = std::min(name.find_first_not_of('-'), name.size());
  std::size_t distance = 2 + (name.size() - dashes) / 4;
  for (const std::string& candidate : candidates) {
    const std::size_t d = levenshtein(name, candidate);
    if (d < distance) {
      distance = d;
      best = candidate;
    }
  }
  return best;
}

std::string did_you_mean(std::string_view name,
                         const std::vector<std::string>& candidates,
                         const std::string& otherwise) {
  const std::string nearest = nearest_name(name, candidates);
  if (!nearest.empty()) return fmt::format(": did you mean '{}'?", nearest);
  if (candidates.empty() || candidates.size() > kFew) return otherwise;
  const auto last = candidates.end() - 1;
  if (last == candidates.begin()) return fmt::format(": use '{}'", *last);
  return fmt::format(": use '{}' or '{}'", fmt::join(candidates.begin(), last, "', '"), *last);
}

}  // namespace raysplats
