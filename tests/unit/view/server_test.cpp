// SPDX-License-Identifier: Apache-2.0
// What goes wrong within a request is no end of the program. In builds without a viewer there is
// none.
#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"
#include "skip_test.hpp"
#include "unit/view/page_client.hpp"
#include "view/viewer.hpp"

using namespace raysplats;
using namespace raysplats::view;

namespace {

template <class Service, class... Arguments>
std::unique_ptr<Service> opened(const Arguments&... arguments) {
  try {
    return std::make_unique<Service>(arguments...);
  } catch (const UsageError& error) {
    REQUIRE(std::string(error.what()).find("RAYSPLATS_VIEWER") != std::string::npos);
    return nullptr;
  }
}

[[noreturn]] void fail() { throw std::runtime_error("nobody expected this"); }

}  // namespace

TEST_CASE("a page whose message ends in an error is let go, and others are served on") {
  std::atomic<int> heard = 0, closed = 0;
  std::atomic<bool> unwelcome = false;
  ServerHandlers handlers;
  handlers.get = [](std::string_view path) {
    if (path == "/bad") fail();
    return HttpReply{200, "text/plain", "good\n"};
  };
  handlers.opened = [&](ClientId) {
    if (unwelcome) fail();
  };
  handlers.message = [&](ClientId, std::string_view text) {
    if (text == "bad") fail();
    ++heard;
  };
  handlers.bytes = [](ClientId, std::span<const std::byte>) { fail(); };
  handlers.closed = [&](ClientId) { ++closed; };
  const auto server = opened<Server>(ServerOptions{}, handlers);
  SKIP_TEST_UNLESS(server, "the viewer is not part of this build");
  const std::string url = server->urls().front();
  CHECK(get(url, "/bad").empty());
  CHECK(get(url, "/good").starts_with("HTTP/1.1 200"));
  {
    Page page(url), other(url);
    page.say("bad");
    CHECK(page.ends());
    other.say("good");
    wait_until([&] { return heard == 1; });
    CHECK(closed == 1);
  }
  wait_until([&] { return closed == 2; });
  unwelcome = true;
  CHECK(Page(url).ends());
  unwelcome = false;
  Page(url).say("good");
  wait_until([&] { return heard == 2; });
}

TEST_CASE("of pictures that a slow page has not taken the newest comes, and the one to be kept") {
  std::atomic<ClientId> client = 0;
  ServerHandlers handlers;
  handlers.get = [](std::string_view) { return HttpReply{200, "text/plain", ""}; };
  handlers.opened = [&](ClientId id) { client = id; };
  handlers.message = [](ClientId, std::string_view) {};
  handlers.closed = [](ClientId) {};
  const auto server = opened<Server>(ServerOptions{}, handlers);
  SKIP_TEST_UNLESS(server, "the viewer is not part of this build");
  Page page(server->urls().front());
  wait_until([&] { return client != 0; });
  // More than sockets take before somebody reads.
  constexpr std::size_t kPictures = 40, kKept = 20;
  const auto word = [](std::size_t i) { return std::string("<").append(std::to_string(i)) + ">"; };
  for (std::size_t i = 0; i < kPictures; ++i) {
    std::vector<std::byte> bytes(std::size_t{1} << 20, std::byte{'.'});
    for (const char c : word(i)) bytes.push_back(static_cast<std::byte>(c));
    server->send_picture(client, std::move(bytes), i == kKept);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  server->send_text(client, "the end");
  const std::string heard = page.hear(word(kPictures - 1));
  std::size_t came = 0;
  for (std::size_t i = 0; i < kPictures; ++i)
    came += heard.find(word(i)) != std::string::npos ? 1 : 0;
  CHECK(came < kPictures);  // else nothing was slow
  const std::size_t kept = heard.find(word(kKept));
  REQUIRE(kept != std::string::npos);
  CHECK(kept < heard.find("the end"));
}

TEST_CASE("photos and figures that cannot be given are one sentence") {
  ViewerOptions options;
  options.run = []() -> std::string { fail(); };
  options.photo = [](std::size_t) -> std::optional<std::string> { fail(); };
  const auto viewer = opened<Viewer>(options);
  SKIP_TEST_UNLESS(viewer, "the viewer is not part of this build");
  const std::string url = viewer->urls().front();
  for (const char* path : {"/api/run", "/api/photo/0"}) {
    const std::string answer = get(url, path);
    CHECK(answer.starts_with("HTTP/1.1 500"));
    CHECK(answer.ends_with("\r\n\r\nnobody expected this\n"));
  }
  CHECK(get(url, "/api/photo/x").starts_with("HTTP/1.1 404"));
}

TEST_CASE("an address that is none of this machine's is told, and no other port asked for") {
  ServerOptions options;
  options.host = "192.0.2.1";  // of documents (RFC 5737)
  std::string told;
  try {
    const Server server(options, ServerHandlers{});
  } catch (const UsageError& error) {
    told = error.what();
  }
  SKIP_TEST_UNLESS(told.find("RAYSPLATS_VIEWER") == std::string::npos,
                   "the viewer is not part of this build");
  CHECK(told.find("--host 192.0.2.1 is no address of this machine") != std::string::npos);
  CHECK(told.find("--port") == std::string::npos);
}
