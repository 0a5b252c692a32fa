// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arpa/inet.h>
#include <doctest/doctest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <string>
#include <thread>
#include <utility>

namespace raysplats::view {

/// A connection to a viewer on 127.0.0.1, which has printed `url`: http://HOST:PORT/?token=TOKEN
class Connection {
 public:
  explicit Connection(const std::string& url) {
    const std::size_t slash = url.find('/', 7);
    host_ = url.substr(7, slash - 7);
    query_ = url.substr(slash + 1);
    socket_ = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port =
        htons(static_cast<std::uint16_t>(std::stoi(host_.substr(host_.find(':') + 1))));
    REQUIRE(::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0);
  }
  ~Connection() { close(); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void close() {
    if (socket_ >= 0) ::close(std::exchange(socket_, -1));
  }
  void write(const std::string& bytes) {
    REQUIRE(::write(socket_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()));
  }
  /// GET with the token and further headers.
  void ask(const std::string& path, const std::string& headers) {
    write("GET " + path + query_ + " HTTP/1.1\r\nHost: " + host_ + "\r\n" + headers + "\r\n");
  }
  /// What comes until `end`, or until the server closes.
  std::string read(const std::string& end) {
    std::string text;
    for (char c = 0; (end.empty() || !text.ends_with(end)) && ::read(socket_, &c, 1) == 1;)
      text += c;
    return text;
  }

 private:
  int socket_ = -1;
  std::string host_, query_;
};

/// The whole answer; nothing where there is none.
inline std::string get(const std::string& url, const std::string& path) {
  Connection connection(url);
  connection.ask(path, "Connection: close\r\n");
  return connection.read("");
}

/// A WebSocket of a page.
class Page {
 public:
  explicit Page(const std::string& url) : connection_(url) {
    connection_.ask("/ws",
                    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n");
    REQUIRE(connection_.read("\r\n\r\n").starts_with("HTTP/1.1 101"));
  }

  void close() { connection_.close(); }
  void say(const std::string& text) {
    std::string frame{static_cast<char>(0x81)};
    if (text.size() < 126) {
      frame += static_cast<char>(0x80 | text.size());
    } else {
      frame += static_cast<char>(0x80 | 126);
      frame += static_cast<char>(text.size() >> 8);
      frame += static_cast<char>(text.size());
    }
    connection_.write(frame + std::string(4, '\0') + text);
  }
  /// Waits for what the server says last: whether that is nothing.
  bool ends() { return connection_.read("").empty(); }
  /// What the server says, up to `end`.
  std::string hear(const std::string& end) { return connection_.read(end); }

 private:
  Connection connection_;
};

template <class Condition>
void wait_until(const Condition& condition) {
  for (int i = 0; i < 1000 && !condition(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  REQUIRE(condition());
}

}  // namespace raysplats::view
