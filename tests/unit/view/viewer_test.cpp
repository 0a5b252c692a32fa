// SPDX-License-Identifier: Apache-2.0
// Pages that go while their picture is chosen or drawn. In builds without a viewer there are none.
#include "view/viewer.hpp"

#include <arpa/inet.h>
#include <doctest/doctest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"

using namespace raysplats;
using namespace raysplats::view;

namespace {

constexpr const char* kView =
    R"({"type":"view","id":1,"c2w":[1,0,0,0,0,1,0,0,0,0,1,0],"size":[8,8],"fov":50})";

/// A WebSocket of a page.
class Page {
 public:
  explicit Page(const Viewer& viewer) {
    const std::string url = viewer.urls().front();  // http://127.0.0.1:PORT/?token=TOKEN
    const std::size_t slash = url.find('/', 7);
    const std::string host = url.substr(7, slash - 7);
    socket_ = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port =
        htons(static_cast<std::uint16_t>(std::stoi(host.substr(host.find(':') + 1))));
    REQUIRE(::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0);
    write("GET /ws" + url.substr(slash + 1) + " HTTP/1.1\r\nHost: " + host +
          "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
          "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n");
    std::string head;
    for (char c = 0; !head.ends_with("\r\n\r\n") && ::read(socket_, &c, 1) == 1;) head += c;
    REQUIRE(head.starts_with("HTTP/1.1 101"));
  }
  ~Page() { close(); }
  Page(const Page&) = delete;
  Page& operator=(const Page&) = delete;

  void close() {
    if (socket_ >= 0) ::close(std::exchange(socket_, -1));
  }
  void say(const std::string& text) {
    std::string frame{static_cast<char>(0x81)};
    if (text.size() < 126) {
      frame += static_cast<char>(0x80 | text.size());
    } else {
      frame += static_cast<char>(0x80 | 126);
      frame += static_cast<char>(text.size() >> 8);
      frame += static_cast<char>(text.size());
    }
    write(frame + std::string(4, '\0') + text);
  }

 private:
  void write(const std::string& bytes) {
    REQUIRE(::write(socket_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()));
  }
  int socket_ = -1;
};

template <class Condition>
void wait_until(const Condition& condition) {
  for (int i = 0; i < 1000 && !condition(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  REQUIRE(condition());
}

class Pictures : public PictureSource {
 public:
  Image draw(const ViewRequest& request, std::uint64_t, const Watch& watch) override {
    ++drawn;
    if (meanwhile) meanwhile();
    goes_on = watch(0.5);
    return Image(request.camera.width, request.camera.height, 4, 0.5f);
  }
  std::optional<glm::dvec3> point(const ViewRequest&) override { return std::nullopt; }
  std::uint64_t samples() const override { return 1; }
  bool has_depth() const override { return false; }

  int drawn = 0;
  bool goes_on = false;
  std::function<void()> meanwhile;
};

std::unique_ptr<Viewer> opened() {
  try {
    return std::make_unique<Viewer>(ViewerOptions{});
  } catch (const UsageError& error) {
    REQUIRE(std::string(error.what()).find("RAYSPLATS_VIEWER") != std::string::npos);
    return nullptr;
  }
}

}  // namespace

TEST_CASE("nothing is drawn for a page that goes between its choice and its picture") {
  const std::unique_ptr<Viewer> viewer = opened();
  if (!viewer) return;
  for (const bool closes : {true, false}) {
    CAPTURE(closes);
    Page page(*viewer);
    Pictures pictures;
    // Commands are obeyed when the page that is served next has been chosen.
    viewer->on_command([&](const RunCommand&) {
      if (closes) {
        page.close();
      } else {
        page.say(R"({"type":"leave"})");
      }
      wait_until([&] { return viewer->watchers() == 0; });
    });
    page.say(kView);
    page.say(R"({"type":"save"})");
    wait_until([&] { return viewer->watchers() == 1 && viewer->asked(); });
    CHECK(viewer->work(pictures, 0, 1.0));
    CHECK(pictures.drawn == 0);
  }
}

TEST_CASE("a picture ends when its page has gone") {
  const std::unique_ptr<Viewer> viewer = opened();
  if (!viewer) return;
  Page page(*viewer);
  Pictures pictures;
  page.say(kView);
  wait_until([&] { return viewer->watchers() == 1; });
  CHECK(viewer->work(pictures, 0, 1.0));
  CHECK(pictures.goes_on);
  page.say(kView);
  pictures.meanwhile = [&] {
    page.say(R"({"type":"leave"})");
    wait_until([&] { return viewer->watchers() == 0; });
  };
  CHECK(viewer->work(pictures, 0, 5.0));
  CHECK(pictures.drawn == 2);
  CHECK(!pictures.goes_on);
  CHECK(!viewer->work(pictures, 0, 0.0));
}

TEST_CASE("a picture that cannot be drawn is told to its page, which may ask again") {
  const std::unique_ptr<Viewer> viewer = opened();
  if (!viewer) return;
  Page page(*viewer);
  Pictures pictures;
  for (const auto& fail : std::vector<std::function<void()>>{
           [] { throw ResourceError("no memory"); }, [] { throw DeviceError("no kernel"); },
           [] { throw UsageError("no depth"); }, [] { throw std::bad_alloc(); }}) {
    pictures.meanwhile = fail;
    page.say(kView);
    wait_until([&] { return viewer->watchers() == 1; });
    CHECK(viewer->work(pictures, 0, 1.0));
    // Until it asks again nothing is tried.
    CHECK(viewer->watchers() == 0);
    CHECK(!viewer->work(pictures, 0, 0.0));
  }
  pictures.meanwhile = {};
  page.say(kView);
  wait_until([&] { return viewer->watchers() == 1; });
  CHECK(viewer->work(pictures, 0, 1.0));
  CHECK(pictures.drawn == 5);
}
