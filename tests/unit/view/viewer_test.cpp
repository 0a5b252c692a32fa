// SPDX-License-Identifier: Apache-2.0
// Pages that go while their picture is chosen or drawn. In builds without a viewer there are none.
#include "view/viewer.hpp"

#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "raysplats/error.hpp"
#include "skip_test.hpp"
#include "unit/view/page_client.hpp"

using namespace raysplats;
using namespace raysplats::view;

namespace {

constexpr const char* kView =
    R"({"type":"view","id":1,"c2w":[1,0,0,0,0,1,0,0,0,0,1,0],"size":[8,8],"fov":50})";

class Pictures : public PictureSource {
 public:
  Image draw(const ViewRequest& request, std::uint64_t, const Watch& watch) override {
    ++drawn;
    if (meanwhile) meanwhile();
    goes_on = watch(0.5);
    Image picture(request.camera.width, request.camera.height, 4, 0.5f);
    if (side) picture.width = picture.height = *side;
    return picture;
  }
  std::optional<glm::dvec3> point(const ViewRequest&) override { return std::nullopt; }
  std::uint64_t samples() const override { return 1; }
  bool has_depth() const override { return false; }

  int drawn = 0;
  bool goes_on = false;
  std::optional<int> side;  ///< that pictures claim to have
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
  SKIP_TEST_UNLESS(viewer, "the viewer is not part of this build");
  for (const bool closes : {true, false}) {
    CAPTURE(closes);
    Page page(viewer->urls().front());
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

TEST_CASE("a page that wishes more than a screen can show gets sixty pictures a second") {
  const std::unique_ptr<Viewer> viewer = opened();
  SKIP_TEST_UNLESS(viewer, "the viewer is not part of this build");
  Page page(viewer->urls().front());
  Pictures pictures;
  std::atomic<bool> over = false;
  std::thread hasty([&] {
    for (int i = 0; i < 240; ++i) {
      page.say(kView);
      std::this_thread::sleep_for(std::chrono::milliseconds(4));
    }
    over = true;
  });
  const auto start = std::chrono::steady_clock::now();
  while (!over) viewer->work(pictures, 0, 0.05);
  hasty.join();
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  CHECK(pictures.drawn <= 60.0 * seconds + 1);
  CHECK(pictures.drawn > 10);
  // The last wish is seen to.
  viewer->work(pictures, 0, 0.1);
  CHECK(!viewer->work(pictures, 0, 0.1));
}

TEST_CASE("a picture ends when its page has gone") {
  const std::unique_ptr<Viewer> viewer = opened();
  SKIP_TEST_UNLESS(viewer, "the viewer is not part of this build");
  Page page(viewer->urls().front());
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
  SKIP_TEST_UNLESS(viewer, "the viewer is not part of this build");
  Page page(viewer->urls().front());
  Pictures pictures;
  for (const auto& fail : std::vector<std::function<void()>>{
           [] { throw ResourceError("no memory"); }, [] { throw DeviceError("no kernel"); },
           [] { throw UsageError("no depth"); }, [] { throw std::bad_alloc(); },
           [] { throw std::runtime_error("nobody expected this"); }}) {
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
  CHECK(pictures.drawn == 6);
}

TEST_CASE("a picture that cannot be sent is told to its page, and no trouble of the run's") {
  const std::unique_ptr<Viewer> viewer = opened();
  SKIP_TEST_UNLESS(viewer, "the viewer is not part of this build");
  Page page(viewer->urls().front());
  Pictures pictures;
  pictures.side = 1 << 30;  // nobody has room for its copy
  page.say(kView);
  wait_until([&] { return viewer->watchers() == 1; });
  CHECK(viewer->work(pictures, 0, 1.0));
  CHECK(page.hear("}").find("\"type\":\"error\"") != std::string::npos);
  CHECK(viewer->watchers() == 0);
}
