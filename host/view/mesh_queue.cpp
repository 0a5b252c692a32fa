// SPDX-License-Identifier: Apache-2.0
#include "view/mesh_queue.hpp"

#include <algorithm>

#include "raysplats/error.hpp"

namespace raysplats::view {

/// The place that the newer one makes needless, unless the mesh goes in between.
MeshQueue::Waiting* MeshQueue::older_place(const PlaceMesh& place) {
  for (auto each = waiting_.rbegin(); each != waiting_.rend(); ++each) {
    const auto* removed = std::get_if<RemoveMesh>(&each->second);
    if (removed != nullptr && removed->mesh == place.mesh) return nullptr;
    const auto* older = std::get_if<PlaceMesh>(&each->second);
    if (older != nullptr && older->mesh == place.mesh) return &*each;
  }
  return nullptr;
}

void MeshQueue::put(ClientId client, MeshMessage message) {
  if (std::holds_alternative<SentMesh>(message)) {
    const bool taken = std::any_of(waiting_.begin(), waiting_.end(), [](const Waiting& each) {
      return std::holds_alternative<SentMesh>(each.second);
    });
    if (taken) throw UsageError("A mesh is being read already: drop this one again");
  } else {
    const auto* place = std::get_if<PlaceMesh>(&message);
    Waiting* older = place != nullptr ? older_place(*place) : nullptr;
    if (older != nullptr) {
      *older = {client, std::move(message)};
      return;
    }
    if (waiting_.size() >= kMost) {
      throw UsageError(
          "So much waits to be done with meshes that this was left out: do it again in a moment");
    }
  }
  waiting_.emplace_back(client, std::move(message));
}

std::optional<std::pair<ClientId, MeshMessage>> MeshQueue::take() {
  if (waiting_.empty()) return std::nullopt;
  Waiting first = std::move(waiting_.front());
  waiting_.pop_front();
  return first;
}

}  // namespace raysplats::view
