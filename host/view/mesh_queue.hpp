// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <utility>
#include <variant>

#include "view/mesh_uploads.hpp"
#include "view/server.hpp"
#include "view/view_request.hpp"

namespace raysplats::view {

/// What pages say about meshes.
using MeshMessage = std::variant<SentMesh, PlaceMesh, RemoveMesh, MeshQuestion, SceneQuestion>;

/// What they have said, in that order. A mesh that moves waits with its newest place alone.
class MeshQueue {
 public:
  /// Throws UsageError for a mesh while another one waits, and for any other message where kMost
  /// wait already.
  void put(ClientId client, MeshMessage message);
  /// The first of them; nothing where none is left.
  std::optional<std::pair<ClientId, MeshMessage>> take();
  bool empty() const { return waiting_.empty(); }

  static constexpr std::size_t kMost = 16;

 private:
  using Waiting = std::pair<ClientId, MeshMessage>;
  Waiting* older_place(const PlaceMesh& place);
  std::deque<Waiting> waiting_;
};

}  // namespace raysplats::view
