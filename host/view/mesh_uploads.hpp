// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "view/server.hpp"
#include "view/view_request.hpp"

namespace raysplats::view {

/// A mesh as a page has sent it.
struct SentMesh {
  MeshOffer offer;
  std::vector<std::byte> bytes;
};

/// Puts meshes together that come in parts. All pages together send one at a time, so that at most
/// kMostMeshBytes wait, and begin one a second at most.
class MeshUploads {
 public:
  using Clock = std::chrono::steady_clock;

  /// Throws UsageError while another mesh is under way (a page that has sent nothing for 10 s gives
  /// way) and within a second of the one before.
  void begin(ClientId client, const MeshOffer& offer, Clock::time_point now);
  /// The next bytes of the page's mesh; the mesh with its last ones. Bytes that nobody has offered
  /// are left alone. Throws UsageError for more than were offered, which ends the mesh.
  std::optional<SentMesh> take(ClientId client,
                               std::span<const std::byte> part,
                               Clock::time_point now);
  /// The page has gone.
  void forget(ClientId client);

 private:
  struct Upload {
    ClientId client;
    SentMesh mesh;
    Clock::time_point last;  ///< bytes
  };
  std::optional<Upload> upload_;
  std::optional<Clock::time_point> begun_;
};

}  // namespace raysplats::view
