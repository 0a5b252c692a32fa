// SPDX-License-Identifier: Apache-2.0
// What goes wrong within a request is no end of the program. In builds without a viewer there is
// none.
#include <doctest/doctest.h>

#include <atomic>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "page_client.hpp"
#include "raysplats/error.hpp"
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
  if (!server) return;
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

TEST_CASE("photos and figures that cannot be given are one sentence") {
  ViewerOptions options;
  options.run = []() -> std::string { fail(); };
  options.photo = [](std::size_t) -> std::optional<std::string> { fail(); };
  const auto viewer = opened<Viewer>(options);
  if (!viewer) return;
  const std::string url = viewer->urls().front();
  for (const char* path : {"/api/run", "/api/photo/0"}) {
    const std::string answer = get(url, path);
    CHECK(answer.starts_with("HTTP/1.1 500"));
    CHECK(answer.ends_with("\r\n\r\nnobody expected this\n"));
  }
  CHECK(get(url, "/api/photo/x").starts_with("HTTP/1.1 404"));
}
