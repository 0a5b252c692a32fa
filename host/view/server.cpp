// SPDX-License-Identifier: Apache-2.0
// The only file that knows Boost.Beast, which takes long to compile.
#include "view/server.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <deque>
#include <exception>
#include <future>
#include <map>
#include <optional>
#include <thread>
#include <utility>

#include "raysplats/error.hpp"
#include "view/access.hpp"
#include "view/own_addresses.hpp"

namespace raysplats::view {
namespace {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = net::ip::tcp;
using Code = boost::system::error_code;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr std::uint32_t kMostHeader = 8192;
constexpr std::size_t kMostMessage = 65536;
constexpr std::size_t kMostTexts = 64;        ///< that wait for a client
constexpr std::size_t kMostConnections = 64;  ///< open at once
constexpr auto kMessageTime = 4ms;            ///< of a page's messages, at the least
constexpr auto kBurst = 1s;                   ///< that they may come before their time
constexpr std::size_t kMostDrained = 1 << 20;
constexpr auto kDrainTime = 2s;
constexpr auto kRequestTime = 10s;
constexpr auto kIdleTime = 60s;
constexpr auto kAcceptPause = 200ms;
constexpr auto kFlushPause = 5ms;

std::string_view view_of(beast::string_view text) { return {text.data(), text.size()}; }

Credentials credentials_of(const http::request<http::empty_body>& request) {
  const std::string_view target = view_of(request.target());
  const std::size_t question = target.find('?');
  return {view_of(request[http::field::host]), view_of(request[http::field::origin]),
          view_of(request[http::field::cookie]),
          question == std::string_view::npos ? std::string_view() : target.substr(question + 1)};
}

/// Whoever reads another one of them than we do would be let in by ours.
bool says_twice(const http::request<http::empty_body>& request) {
  return request.count(http::field::host) > 1 || request.count(http::field::origin) > 1;
}

std::string_view path_of(const http::request<http::empty_body>& request) {
  const std::string_view target = view_of(request.target());
  return target.substr(0, target.find('?'));
}

}  // namespace

struct Server::Impl {
  class Connection;
  class Channel;

  Impl(const ServerOptions& options, ServerHandlers handlers_in)
      : handlers(std::move(handlers_in)), most_clients(options.max_clients), acceptor(io) {
    Code error;
    const auto address = net::ip::make_address(options.host, error);
    if (error) {
      throw UsageError(fmt::format(
          "--host {} is no address: give one of this machine, such as 127.0.0.1", options.host));
    }
    const tcp::endpoint endpoint(address, options.port);
    acceptor.open(endpoint.protocol(), error);
    if (!error) acceptor.set_option(net::socket_base::reuse_address(true), error);
    // Systems differ in whether :: takes IPv4 too unless it is said.
    if (!error && address.is_v6()) acceptor.set_option(net::ip::v6_only(false), error);
    if (!error) acceptor.bind(endpoint, error);
    if (!error) acceptor.listen(net::socket_base::max_listen_connections, error);
    if (error == boost::system::errc::address_not_available) {
      throw UsageError(fmt::format(
          "--host {} is no address of this machine: give one that is, such as 127.0.0.1, or {} for "
          "all of them",
          options.host, address.is_v6() ? "::" : "0.0.0.0"));
    }
    if (error) {
      throw DataError(
          fmt::format("The viewer cannot listen on {}, port {}: {}; choose another --port",
                      options.host, options.port, error.message()));
    }
    const std::vector<std::string> addresses = address.is_unspecified()
                                                   ? own_addresses(address.is_v6())
                                                   : std::vector{address.to_string()};
    access.emplace(random_token(), addresses, acceptor.local_endpoint().port());
    accept();
    thread = std::thread([this] { serve(); });
  }
  ~Impl() {
    io.stop();
    thread.join();
  }

  void accept();
  void serve();

  std::size_t connections = 0;  // before what may hold connections to the end
  net::io_context io{1};
  ServerHandlers handlers;
  std::size_t most_clients;
  std::optional<Access> access;
  tcp::acceptor acceptor;
  net::steady_timer pause{io};
  ClientId last_client = 0;
  std::map<ClientId, std::shared_ptr<Channel>> channels;
  std::thread thread;
};

/// A page's WebSocket.
class Server::Impl::Channel : public std::enable_shared_from_this<Channel> {
 public:
  Channel(Impl& server, beast::tcp_stream stream)
      : server_(server), id_(++server.last_client), socket_(std::move(stream)), rest_(server.io) {}

  void start(const http::request<http::empty_body>& request) {
    socket_.next_layer().expires_never();
    websocket::stream_base::timeout timeout{kRequestTime, kIdleTime, true};
    socket_.set_option(timeout);
    socket_.read_message_max(kMostMessage);
    socket_.async_accept(request, [self = shared_from_this()](Code error) {
      if (error) return;
      self->server_.channels[self->id_] = self;
      self->open_ = true;
      self->attempt([&] { self->server_.handlers.opened(self->id_); });
      self->read();
    });
  }

  bool idle() const { return texts_.empty() && !kept_ && !writing_; }

  void send_text(std::string text) {
    if (texts_.size() >= kMostTexts) return;
    texts_.push_back(std::move(text));
    write();
  }
  void send_picture(std::vector<std::byte> bytes, bool kept) {
    (kept ? kept_ : picture_) = std::move(bytes);
    write();
  }

 private:
  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](Code error, std::size_t) {
      if (error) return self->close();
      self->attempt([&] { self->take(); });
      self->buffer_.consume(self->buffer_.size());
      self->read_in_time();
    });
  }

  /// A page that talks faster than anybody can has to wait. Nothing of what it says is lost: a mesh
  /// comes in many messages.
  void read_in_time() {
    const auto now = Clock::now();
    due_ = std::max(due_, now - kBurst) + kMessageTime;
    if (due_ <= now) return read();
    rest_.expires_at(due_);
    rest_.async_wait([self = shared_from_this()](Code stopped) {
      if (!stopped) self->read();
    });
  }

  void take() {
    const auto data = buffer_.data();
    if (socket_.got_text()) {
      server_.handlers.message(id_, {static_cast<const char*>(data.data()), data.size()});
    } else if (server_.handlers.bytes) {
      server_.handlers.bytes(id_, {static_cast<const std::byte*>(data.data()), data.size()});
    }
  }

  /// A page whose message ends in an error that nobody expected is let go: what it is owed is not
  /// known. Others are served on.
  template <class Work>
  void attempt(const Work& work) {
    try {
      work();
    } catch (...) {
      close();
      throw;
    }
  }

  void write() {
    if (writing_ || !open_ || (texts_.empty() && !kept_ && !picture_)) return;
    writing_ = true;
    net::const_buffer out;
    // What is to be kept goes before the word that the run has ended.
    if (!kept_ && !texts_.empty()) {
      socket_.text(true);
      text_in_work_ = std::move(texts_.front());
      texts_.pop_front();
      out = net::buffer(text_in_work_);
    } else {
      socket_.binary(true);
      std::optional<std::vector<std::byte>>& next = kept_ ? kept_ : picture_;
      picture_in_work_ = std::move(*next);
      next.reset();
      out = net::buffer(picture_in_work_);
    }
    socket_.async_write(out, [self = shared_from_this()](Code error, std::size_t) {
      self->writing_ = false;
      if (error) return self->close();
      self->write();
    });
  }

  void close() {
    if (!open_) return;
    open_ = false;
    server_.channels.erase(id_);
    server_.handlers.closed(id_);
  }

  Impl& server_;
  ClientId id_;
  websocket::stream<beast::tcp_stream> socket_;
  net::steady_timer rest_;
  Clock::time_point due_;  ///< of the next message
  beast::flat_buffer buffer_;
  std::deque<std::string> texts_;
  std::optional<std::vector<std::byte>> picture_, kept_;
  std::string text_in_work_;
  std::vector<std::byte> picture_in_work_;
  bool writing_ = false;
  bool open_ = false;
};

/// A connection that speaks HTTP.
class Server::Impl::Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Impl& server, tcp::socket socket)
      : server_(server), stream_(std::move(socket)), buffer_(kMostHeader + 1024) {
    ++server_.connections;
  }
  ~Connection() { --server_.connections; }

  void read() {
    parser_.emplace();
    parser_->header_limit(kMostHeader);
    parser_->body_limit(std::uint64_t{0});
    stream_.expires_after(kRequestTime);
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](Code error, std::size_t) { self->taken(error); });
  }

 private:
  void taken(const Code& error) {
    if (error == http::error::header_limit || error == http::error::buffer_overflow)
      return last_words({431, "text/plain", "The header is too long\n"});
    if (error == http::error::body_limit)
      return last_words({413, "text/plain", "Requests have no body here\n"});
    if (error) return;
    const auto& request = parser_->get();
    const Verdict verdict =
        says_twice(request) ? Verdict::kForbidden : server_.access->judge(credentials_of(request));
    if (verdict == Verdict::kForbidden) {
      return last_words(
          {403, "text/plain", "Forbidden: open the address that raysplats has printed\n"});
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head)
      return last_words({405, "text/plain", "Only GET is answered\n"});
    if (websocket::is_upgrade(request)) {
      if (path_of(request) != "/ws") return last_words({404, "text/plain", "Not found\n"});
      if (server_.channels.size() >= server_.most_clients)
        return last_words({503, "text/plain", "Too many pages are open\n"});
      const auto channel = std::make_shared<Channel>(server_, std::move(stream_));
      return channel->start(request);
    }
    if (path_of(request) == "/" && verdict == Verdict::kTakeCookie) {
      reply({303, "text/plain", ""}, true, request.keep_alive());
    } else {
      reply(server_.handlers.get(path_of(request)), false, request.keep_alive());
    }
  }

  void last_words(const HttpReply& what) { reply(what, false, false); }

  void reply(const HttpReply& what, bool take_cookie, bool keep) {
    reply_ = {};
    reply_.result(static_cast<unsigned>(what.status));
    reply_.version(11);
    reply_.set(http::field::content_type, what.type);
    reply_.set(http::field::cache_control, "no-store");
    reply_.set(http::field::x_frame_options, "DENY");
    reply_.set("X-Content-Type-Options", "nosniff");
    reply_.set("Referrer-Policy", "no-referrer");
    reply_.set("Content-Security-Policy",
               "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: "
               "data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
               "frame-ancestors 'none'");
    if (take_cookie) {
      reply_.set(http::field::location, "/");
      reply_.set(http::field::set_cookie, server_.access->cookie());
    }
    reply_.keep_alive(keep);
    reply_.body() = what.body;
    reply_.prepare_payload();
    if (parser_->get().method() == http::verb::head) reply_.body().clear();
    stream_.expires_after(kRequestTime);
    http::async_write(stream_, reply_, [self = shared_from_this(), keep](Code error, std::size_t) {
      if (!error && keep) return self->read();
      Code ignored;
      self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
      self->stream_.expires_after(kDrainTime);
      self->drain(kMostDrained);
    });
  }

  /// To close with bytes unread would reset the connection, and the reply might never be seen.
  void drain(std::size_t most) {
    buffer_.clear();
    stream_.async_read_some(buffer_.prepare(kMostHeader),
                            [self = shared_from_this(), most](Code error, std::size_t count) {
                              if (!error && count < most) self->drain(most - count);
                            });
  }

  Impl& server_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::empty_body>> parser_;
  http::response<http::string_body> reply_;
};

void Server::Impl::accept() {
  acceptor.async_accept([this](Code error, tcp::socket socket) {
    if (!error && connections < kMostConnections)
      std::make_shared<Connection>(*this, std::move(socket))->read();
    if (!error) return accept();
    // Out of descriptors, as a rule: trying again at once would keep a core busy.
    pause.expires_after(kAcceptPause);
    pause.async_wait([this](Code stopped) {
      if (!stopped) accept();
    });
  });
}

/// The program that shows something has more to do than to show it: a training run does not end by
/// what a page did.
void Server::Impl::serve() {
  for (bool ended = false; !ended;) {
    try {
      io.run();
      ended = true;
    } catch (const std::exception& error) {
      spdlog::warn("the viewer has dropped a request: {}", error.what());
    }
  }
}

Server::Server(const ServerOptions& options, ServerHandlers handlers)
    : impl_(std::make_unique<Impl>(options, std::move(handlers))) {}

Server::~Server() = default;

std::vector<std::string> Server::urls() const { return impl_->access->urls(); }

void Server::send_picture(ClientId client, std::vector<std::byte> bytes, bool kept) {
  net::post(impl_->io, [impl = impl_.get(), client, bytes = std::move(bytes), kept]() mutable {
    const auto found = impl->channels.find(client);
    if (found != impl->channels.end()) found->second->send_picture(std::move(bytes), kept);
  });
}

void Server::send_text(ClientId client, std::string text) {
  net::post(impl_->io, [impl = impl_.get(), client, text = std::move(text)]() mutable {
    const auto found = impl->channels.find(client);
    if (found != impl->channels.end()) found->second->send_text(std::move(text));
  });
}

void Server::flush(double seconds) {
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  for (bool idle = false; !idle && Clock::now() < end;) {
    std::promise<bool> answer;
    net::post(impl_->io, [&] {
      answer.set_value(std::all_of(impl_->channels.begin(), impl_->channels.end(),
                                   [](const auto& each) { return each.second->idle(); }));
    });
    idle = answer.get_future().get();
    if (!idle) std::this_thread::sleep_for(kFlushPause);
  }
}

}  // namespace raysplats::view
