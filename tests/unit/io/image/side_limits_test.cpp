// SPDX-License-Identifier: Apache-2.0
#include "io/image/side_limits.hpp"

#include <doctest/doctest.h>

#include <string>

#include "io/image/video_file.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "unit/io/scratch.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

template <class Action>
std::string usage_error(Action action) {
  try {
    action();
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("every format has its largest side, either way round") {
  struct Limit {
    const char* name;
    const char* format;
    int most;
  };
  for (const Limit& limit : {Limit{"a.jpg", "JPEG", 65500}, Limit{"b/a.JPEG", "JPEG", 65500},
                             Limit{"a.png", "PNG", 1000000}, Limit{"a.apng", "APNG", 1000000},
                             Limit{"a.gif", "GIF", 65535}, Limit{"a.mp4", "H.264", 16384}}) {
    CAPTURE(limit.name);
    CHECK_NOTHROW(io::require_writable_size(limit.name, limit.most, limit.most));
    for (const bool wide : {false, true}) {
      const std::string message = usage_error([&] {
        io::require_writable_size(limit.name, wide ? limit.most + 1 : 1, wide ? 1 : limit.most + 1);
      });
      CHECK(message.starts_with(limit.name));
      CHECK(contains(message, std::string(limit.format) + " has at most"));
      CHECK(contains(message, std::to_string(limit.most) + " a side: make it smaller"));
    }
  }
  CHECK_NOTHROW(io::require_writable_size("a.exr", 1 << 20, 1 << 20));
}

TEST_CASE("pictures that are larger than their format are refused, and nothing is written") {
  const Scratch scratch;
  for (const char* name : {"a.jpg", "a.png"}) {
    const int most = name == std::string("a.jpg") ? 65500 : 1000000;
    CHECK(usage_error([&] { write_image(scratch / name, Image(most + 1, 1, 3)); }) != "");
    CHECK(usage_error([&] { write_image(scratch / name, Image(1, most + 1, 1)); }) != "");
    CHECK(fs::is_empty(scratch.path()));
  }
  write_image(scratch / "a.jpg", Image(65500, 1, 3, 0.5f));
  write_image(scratch / "b.exr", Image(65501, 1, 3, 0.5f));
  CHECK(fs::file_size(scratch / "a.jpg") > 0);
  CHECK(fs::file_size(scratch / "b.exr") > 0);
}

TEST_CASE("frames that are larger than a video's format are refused") {
  const Scratch scratch;
  for (const char* name : {"a.gif", "a.apng"}) {
    CAPTURE(name);
    const int most = name == std::string("a.gif") ? 65535 : 1000000;
    const auto video = open_video(scratch / name, {10.0, 1});
    CHECK(contains(usage_error([&] { video->add(Image(most + 1, 1, 3)); }), name));
  }
  CHECK(fs::is_empty(scratch.path()));
  const auto gif = open_video(scratch / "b.gif", {10.0, 1});
  gif->add(Image(65535, 1, 3, 0.5f));
  gif->finish();
  const std::string bytes = read_bytes(scratch / "b.gif");
  CHECK(bytes.substr(6, 4) == std::string("\xff\xff\x01\x00", 4));
}

TEST_CASE("frames that stay for longer than a video's format can say are refused") {
  const Scratch scratch;
  for (const auto& [name, seconds] : {std::pair("a.gif", 655.35), {"a.apng", 65.535}}) {
    CAPTURE(name);
    CHECK(contains(usage_error([&] { open_video(scratch / name, {0.999 / seconds, 1}); }), name));
    const auto video = open_video(scratch / name, {1.0 / seconds, 1});
    video->add(Image(2, 2, 3, 0.5f));
    video->finish();
    const std::string bytes = read_bytes(scratch / name);
    const bool gif = name == std::string("a.gif");
    const std::size_t at = gif ? bytes.find("\x21\xf9") + 4 : bytes.find("fcTL") + 24;
    CHECK(bytes.substr(at, 2) == "\xff\xff");
  }
}
