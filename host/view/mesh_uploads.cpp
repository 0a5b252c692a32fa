// SPDX-License-Identifier: Apache-2.0
#include "view/mesh_uploads.hpp"

#include <utility>

#include "raysplats/error.hpp"

namespace raysplats::view {
namespace {

using namespace std::chrono_literals;

constexpr auto kPatience = 10s;  // with a page that sends nothing
constexpr auto kPause = 1s;      // between the beginnings of two meshes

}  // namespace

void MeshUploads::begin(ClientId client, const MeshOffer& offer, Clock::time_point now) {
  if (upload_ && now - upload_->last < kPatience)
    throw UsageError("Another mesh is on its way: drop this one again when it is there");
  if (begun_ && now - *begun_ < kPause)
    throw UsageError("Meshes come one a second at most: drop this one again");
  begun_ = now;
  upload_ = Upload{client, {offer, {}}, now};
}

std::optional<SentMesh> MeshUploads::take(ClientId client,
                                          std::span<const std::byte> part,
                                          Clock::time_point now) {
  if (!upload_ || upload_->client != client) return std::nullopt;
  std::vector<std::byte>& bytes = upload_->mesh.bytes;
  if (part.size() > upload_->mesh.offer.bytes - bytes.size()) {
    upload_.reset();
    throw UsageError("The mesh has more bytes than the page has announced: drop it again");
  }
  bytes.insert(bytes.end(), part.begin(), part.end());
  upload_->last = now;
  if (bytes.size() < upload_->mesh.offer.bytes) return std::nullopt;
  return std::exchange(upload_, std::nullopt)->mesh;
}

void MeshUploads::forget(ClientId client) {
  if (upload_ && upload_->client == client) upload_.reset();
}

}  // namespace raysplats::view
