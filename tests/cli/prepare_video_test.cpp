// SPDX-License-Identifier: Apache-2.0
// `prepare` of videos, with a stand-in for FFmpeg and with the real one.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "../skip_test.hpp"
#include "prepare_stage.hpp"
#include "program.hpp"
#include "raysplats/io.hpp"

namespace fs = std::filesystem;

TEST_CASE("prepare takes the sharpest of every three frames of a video") {
  const Stage stage;
  write_file(stage.path("walk.mp4"), "a video");
  stage.write("bin/ffprobe", "#!/bin/sh\necho avg_frame_rate=30/1\necho duration=12.5\n");
  std::string script =
      "#!/bin/sh\necho \"$@\" >> \"$CALLS\"\nfor last; do :; done\n"
      "cd \"$(dirname \"$last\")\" || exit 1\n";
  // Three groups of three frames, of each of which one has an edge.
  for (int i = 1; i <= 9; ++i) {
    raysplats::Image frame(8, 6, 3, 0.1f + 0.05f * static_cast<float>(i));
    const bool sharp = i == 2 || i == 4 || i == 9;
    for (int y = 0; sharp && y < 6; ++y) frame.at(4, y, 0) = 1.0f;
    const std::string name = "frame_00000" + std::to_string(i) + ".jpg";
    raysplats::write_image(stage.path(name), frame);
    script += "cp '" + stage.path(name) + "' .\n";
  }
  stage.write("bin/ffmpeg", script);
  const Outcome outcome =
      stage.run({stage.path("walk.mp4"), "-o", stage.path("data"), "--frames", "3"});
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  const std::string calls = stage.calls();
  CHECK(contains(calls, "fps=0.720000"));  // 9 frames of 12.5 s
  CHECK(contains(calls, "--ImageReader.single_camera 1"));
  CHECK(contains(calls, "sequential_matcher"));
  CHECK(entries(stage.path("data/images")) == 3);
  for (const char* name : {"frame_000002.jpg", "frame_000004.jpg", "frame_000009.jpg"})
    CHECK(fs::exists(stage.path("data/images/" + std::string(name))));
}

TEST_CASE("prepare takes the length of a video that states none from its packets") {
  const Stage stage;
  const auto prepared = [&] {
    return stage.run({stage.path("walk.mp4"), "-o", stage.path("data"), "--frames", "3"});
  };
  const auto packets = [](const std::vector<std::string>& times) {
    std::string said;
    for (const std::string& time : times) said += "pts_time=" + time + "\\n";
    return said;
  };
  stage.write_video("N/A", packets({"0.5", "0.9", "0.7", "N/A", "1.3", "1.1"}));
  const Outcome outcome = prepared();
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  CHECK(contains(stage.calls(), "fps=9.000000"));  // 9 frames of five times 0.2 s
  stage.write_video("N/A", packets({"N/A", "N/A"}));
  const Outcome without = prepared();
  CHECK(without.code == 3);
  CHECK(contains(without.err, "walk.mp4 states no length"));
  CHECK(contains(without.err, "'ffmpeg -i walk.mp4 -c copy walk_anew.mp4'"));
  stage.write_video("N/A", "");
  const Outcome none = prepared();
  CHECK(none.code == 3);
  CHECK(contains(none.err, "walk.mp4 is no video that ffmpeg can read"));
}

TEST_CASE("the real FFmpeg keeps the colours of a video, in folders of any name") {
  const Stage stage;
  const std::string folder = stage.path("50%d off");
  fs::create_directories(folder);
  const std::string clip = folder + "/red.mp4";
  const std::string make =
      "ffmpeg -nostdin -v error -f lavfi -i color=0xC8281E:s=64x48:r=10:d=1 "
      "-f lavfi -i testsrc2=s=16x16:r=10:d=1 -filter_complex "
      "'overlay,format=gbrp,scale=out_color_matrix=bt709:flags=accurate_rnd' -pix_fmt yuv420p "
      "-colorspace bt709 -color_primaries bt709 -color_trc bt709 -c:v mpeg4 -q:v 2 '" +
      clip + "'";
  SKIP_TEST_UNLESS(std::system(make.c_str()) == 0, "there is no ffmpeg that writes MPEG-4");
  const Outcome outcome = stage.run({clip, "-o", folder + "/data", "--frames", "3"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(entries(folder + "/data/images") == 3);
  for (const fs::directory_entry& frame : fs::directory_iterator(folder + "/data/images")) {
    const raysplats::Image image = raysplats::read_image(frame.path());
    REQUIRE(image.channels == 3);
    constexpr float kExpected[] = {200, 40, 30};
    for (int c = 0; c < 3; ++c)
      CHECK(std::abs(255.0f * image.at(32, 24, c) - kExpected[c]) <= 4.0f);
  }
}

TEST_CASE("prepare asks a video for no more frames than it has, and warns of HDR") {
  const Stage stage;
  const auto prepared = [&] {
    return stage.run({stage.path("walk.mp4"), "-o", stage.path("data"), "--frames", "100"});
  };
  stage.write_video("5", "", "avg_frame_rate=3/2\\ncolor_transfer=bt709\\n");
  const Outcome outcome = prepared();
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  CHECK(contains(stage.calls(), "fps=3.000000"));
  // All that the stand-in makes are the same.
  CHECK(entries(stage.path("data/images")) == 1);
  CHECK(contains(outcome.err, "walk.mp4 gives 1 different frame, not the 100 asked for"));
  CHECK(!contains(outcome.err, "HDR"));
  for (const std::string transfer : {"arib-std-b67", "smpte2084"}) {
    fs::remove_all(stage.path("data"));
    stage.write_video("5", "", "color_transfer=" + transfer + "\\navg_frame_rate=3/2\\n");
    CHECK(contains(prepared().err, "warning: " + stage.path("walk.mp4") + " is an HDR video"));
  }
}

TEST_CASE("the real FFmpeg gives no frame of a video twice, also where its rate varies") {
  const Stage stage;
  // All of 12, 9 of them, and a burst of 4 that 2 slow ones follow.
  const std::vector<std::pair<std::string, std::size_t>> kinds{
      {"1", 12}, {"not(eq(mod(n,4),1))", 9}, {"lt(n,4)+eq(n,7)+eq(n,11)", 6}};
  for (const auto& kind : kinds) {
    const auto [frames, count] = kind;
    CAPTURE(kind.first);
    const std::string clip = stage.path("clip.mp4");
    const std::string make = fmt::format(
        "ffmpeg -nostdin -y -v error -f lavfi -i testsrc2=s=64x48:r=10:d=1.2 -vf \"select='{}'\" "
        "-vsync vfr -c:v mpeg4 -q:v 2 '{}'",
        frames, clip);
    SKIP_TEST_UNLESS(std::system(make.c_str()) == 0, "there is no ffmpeg that writes MPEG-4");
    const Outcome outcome =
        stage.run({clip, "-o", stage.path(std::to_string(count)), "--frames", "50"});
    INFO(outcome.err);
    CHECK(outcome.code == 0);
    CHECK(entries(stage.path(std::to_string(count)) + "/images") == count);
    CHECK(contains(outcome.err, std::to_string(count) + " different frames, not the 50"));
  }
}
