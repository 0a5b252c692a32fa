// SPDX-License-Identifier: Apache-2.0
// In place of server.cpp in builds without RAYSPLATS_VIEWER.
#include "raysplats/error.hpp"
#include "view/server.hpp"

namespace raysplats::view {

struct Server::Impl {};

Server::Server(const ServerOptions&, ServerHandlers) {
  throw UsageError(
      "This build has no viewer: configure it with -DRAYSPLATS_VIEWER=ON, which needs the headers "
      "of Boost");
}

Server::~Server() = default;

std::vector<std::string> Server::urls() const { return {}; }

void Server::send_picture(ClientId, std::vector<std::byte>, bool) {}

void Server::flush(double) {}
void Server::send_text(ClientId, std::string) {}

}  // namespace raysplats::view
