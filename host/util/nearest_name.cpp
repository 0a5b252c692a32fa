// SPDX-License-Identifier: Apache-2.0
#include "util/nearest_name.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>

namespace raysplats {
namespace {

constexpr std::size_t kFew = 12;       // names that a message lists
constexpr std::size_t kLeastPart = 4;  // letters of a name that tell which is meant

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

std::string_view without_dashes(std::string_view name) {
  return name.substr(std::min(name.find_first_not_of('-'), name.size()));
}

bool holds(std::string_view whole, std::string_view part) {
  return part.size() >= kLeastPart && whole.find(part) != std::string_view::npos;
}

}  // namespace

std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates) {
  const std::string_view bare = without_dashes(name);
  const std::size_t near = 1 + (bare.size() + 1) / 4;
  std::string best;
  std::size_t distance = static_cast<std::size_t>(-1);
  for (const std::string& candidate : candidates) {
    const std::size_t d = levenshtein(name, candidate);
    if (d < distance &&
        (d <= near || holds(candidate, bare) || holds(name, without_dashes(candidate)))) {
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
  std::vector<std::string> names;
  for (const std::string& candidate : candidates) {
    if (!candidate.empty() && std::find(names.begin(), names.end(), candidate) == names.end())
      names.push_back(candidate);
  }
  if (names.empty() || names.size() > kFew) return otherwise;
  const std::string last = names.back();
  names.pop_back();
  if (names.empty()) return fmt::format(": use '{}'", last);
  return fmt::format(": use '{}' or '{}'", fmt::join(names, "', '"), last);
}

}  // namespace raysplats
