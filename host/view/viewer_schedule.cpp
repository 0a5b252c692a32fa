// SPDX-License-Identifier: Apache-2.0
// Which page is served next: whoever moves before whoever rests, then whoever has waited longest.
#include <algorithm>

#include "view/viewer_impl.hpp"

namespace raysplats::view {

std::optional<ClientId> Viewer::Impl::next(std::uint64_t most, Clock::time_point now) const {
  std::optional<ClientId> best;
  bool best_moves = false;
  std::uint64_t best_turn = 0;
  for (const auto& [id, client] : clients) {
    if (!client.wanted || !client.ready(now)) continue;
    if (client.drawn >= samples_of(*client.wanted, most)) continue;
    const bool moves = client.wanted->moving;
    if (!best || (moves && !best_moves) || (moves == best_moves && client.turn < best_turn)) {
      best = id;
      best_moves = moves;
      best_turn = client.turn;
    }
  }
  return best;
}

std::optional<ClientId> Viewer::Impl::next_pick(Clock::time_point now) const {
  for (const auto& each : picks) {
    if (now >= clients.at(each.first).due) return each.first;
  }
  return std::nullopt;
}

bool Viewer::Impl::has_work(std::uint64_t most, Clock::time_point now) const {
  return !commands.empty() || !about_meshes.empty() || next_pick(now) || next(most, now);
}

Clock::time_point Viewer::Impl::next_due(Clock::time_point now) const {
  auto soonest = Clock::time_point::max();
  for (const auto& [id, client] : clients) {
    const bool waits = (client.wanted && client.fresh) || picks.contains(id);
    if (waits && client.due > now) soonest = std::min(soonest, client.due);
  }
  return soonest;
}

std::uint64_t Viewer::Impl::samples_of(const ViewRequest& request, std::uint64_t most) const {
  // Depths of several samples have no common scale, and what moves has no time.
  return request.moving || hurry > 0.0 || request.output == Output::kDepth ? 1 : most;
}

}  // namespace raysplats::view
