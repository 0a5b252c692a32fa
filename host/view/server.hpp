// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace raysplats::view {

/// A page that has an open channel.
using ClientId = std::uint64_t;

struct HttpReply {
  int status = 200;
  std::string type;  ///< Content-Type
  std::string body;
};

struct ServerOptions {
  std::string host = "127.0.0.1";  ///< address to listen on; 0.0.0.0 and ::, all of this machine
  std::uint16_t port = 0;          ///< 0 = any that is free
  std::size_t max_clients = 8;     ///< pages at once
};

/// What the server calls, from its own thread.
struct ServerHandlers {
  /// The answer to GET of a path without its query.
  std::function<HttpReply(std::string_view path)> get;
  std::function<void(ClientId)> opened;
  std::function<void(ClientId, std::string_view text)> message;
  /// A binary message; none: they are left alone.
  std::function<void(ClientId, std::span<const std::byte> bytes)> bytes;
  std::function<void(ClientId)> closed;
};

/// HTTP and WebSocket on one address, for those whom Access allows; everybody else gets 403. Only
/// GET and HEAD are answered; what a request may cost is limited (8 KiB of header, no body, 64 KiB
/// a message, 250 messages a second, 10 s to make up one's mind). One thread serves all. A slow
/// client costs nothing: of the pictures that it has not taken only the newest waits, and the
/// newest that is to be kept.
class Server {
 public:
  /// Listens. Throws UsageError for an address that is none, DataError for a port that is taken,
  /// and UsageError in builds without RAYSPLATS_VIEWER.
  Server(const ServerOptions& options, ServerHandlers handlers);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// The addresses to open, with the token: one, or those of all interfaces when it listens on all.
  std::vector<std::string> urls() const;
  /// May be called from any thread, as send_text(). A picture replaces the one that still waits,
  /// one that is to be kept only another such one; texts wait in line.
  void send_picture(ClientId client, std::vector<std::byte> bytes, bool kept = false);
  void send_text(ClientId client, std::string text);
  /// Waits up to `seconds` until the texts and the pictures to be kept that were sent are on their
  /// way.
  void flush(double seconds);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats::view
