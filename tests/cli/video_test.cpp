// SPDX-License-Identifier: Apache-2.0
// Frames of `render` as videos, by a stand-in for ffmpeg and by the formats that need no program.
#include <doctest/doctest.h>
#include <signal.h>

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "../skip_test.hpp"
#include "program.hpp"

namespace fs = std::filesystem;

namespace {

/// Writes a model of three balls; `render` of an orbit of `frames` small pictures of it.
Words orbit(const TemporaryFolder& folder, const std::string& frames) {
  const std::string path = folder / "balls.ply";
  if (!fs::exists(path)) write_file(path, ply_file(3));
  return {"render", path, "--orbit", frames, "--width", "33", "--height", "24", "-q"};
}

/// A program `ffmpeg` that keeps its words and what it reads, and ends with `code`.
Surroundings with_ffmpeg(const TemporaryFolder& folder, const std::string& body) {
  const std::string path = folder / "bin/ffmpeg";
  write_file(path, "#!/bin/sh\nfor word; do :; done\n" + body);
  fs::permissions(path, fs::perms::owner_all);
  return {{{"PATH", (folder / "bin") + ":/usr/bin:/bin"}}};
}

std::uint32_t big_endian(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<std::uint8_t>(bytes[at + i]);
  return value;
}

/// How long the pictures of a GIF stay, in 1/100 s.
std::vector<int> lengths_of(const std::string& gif) {
  std::vector<int> lengths;
  const std::string control("\x21\xf9\x04", 3);
  for (std::size_t at = gif.find(control); at != std::string::npos; at = gif.find(control, at + 1))
    lengths.push_back(static_cast<std::uint8_t>(gif[at + 4]) |
                      static_cast<std::uint8_t>(gif[at + 5]) << 8);
  return lengths;
}

}  // namespace

TEST_CASE("ffmpeg gets every frame as bytes, and the file appears when it is done") {
  const TemporaryFolder folder;
  const std::string video = folder / "out.mp4";
  const Surroundings around =
      with_ffmpeg(folder, "echo \"$@\" > '" + (folder / "words") + "'; cat > \"$word\"; exit 0\n");
  const Words command = orbit(folder, "3") + Words{"--video", video, "--fps", "12"};
  const Outcome outcome = raysplats_program(command, around);
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  const std::string bytes = read_file(video);
  CHECK(bytes.size() == 3 * 3 * 33 * 24);
  CHECK(bytes.find_first_not_of('\0') != std::string::npos);
  const std::string words = read_file(folder / "words");
  for (const char* part : {"-s 33x24", "-r 12 ", "-pix_fmt yuv420p", "libx264", "crop="})
    CHECK_MESSAGE(words.find(part) != std::string::npos, part);
  // A video that is there stays.
  CHECK(raysplats_program(command, around).code == 2);
  CHECK(raysplats_program(command + Words{"--overwrite"}, around).code == 0);
}

TEST_CASE("seconds of a video say how fast its frames go, whatever the cameras are") {
  const TemporaryFolder folder;
  const Words command = orbit(folder, "8") + Words{"--video", folder / "out.gif"};
  REQUIRE(raysplats_program(command + Words{"--seconds", "2"}).code == 0);
  CHECK(lengths_of(read_file(folder / "out.gif")) == std::vector<int>(8, 25));
  const auto refused = [&](const Words& words, const std::string& part) {
    const Outcome outcome = raysplats_program(words);
    INFO(outcome.err);
    CHECK(outcome.code == 2);
    CHECK(outcome.err.find(part) != std::string::npos);
  };
  refused(command + Words{"--overwrite", "--seconds", "2", "--fps", "4"}, "give one");
  refused(command + Words{"--overwrite", "--seconds", "0.001"}, "8000 a second");
  refused(orbit(folder, "8") + Words{"-o", folder / "frames", "--seconds", "2"}, "no time");
}

TEST_CASE("the real ffmpeg writes every frame, where it is installed") {
  SKIP_TEST_UNLESS(
      std::system("command -v ffmpeg > /dev/null && command -v ffprobe > /dev/null") == 0,
      "there is no ffmpeg");
  const TemporaryFolder folder;
  for (const char* name : {"out.mp4", "out.webm"}) {
    CAPTURE(name);
    const Outcome outcome =
        raysplats_program(orbit(folder, "7") + Words{"--video", folder / name, "--seconds", "0.5"});
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    const std::string command =
        "ffprobe -v error -count_frames -select_streams v -show_entries "
        "stream=nb_read_frames,r_frame_rate,width,height -of default=nw=1 '" +
        (folder / name) + "' > '" + (folder / "told") + "'";
    REQUIRE(std::system(command.c_str()) == 0);
    const std::string told = read_file(folder / "told");
    INFO(told);
    // H.264 halves colours, so that a column is left out.
    for (const char* part : {"nb_read_frames=7", "r_frame_rate=14/1", "height=24"})
      CHECK_MESSAGE(told.find(part) != std::string::npos, part);
    CHECK(told.find("width=3") != std::string::npos);
  }
}

TEST_CASE("Ctrl-C ends a video as it ends files, also while ffmpeg takes its time") {
  const TemporaryFolder folder;
  // As ffmpeg does it: signals do not end what waits for more.
  Surroundings around =
      with_ffmpeg(folder, "trap 'exit 255' INT\ntrap : TERM\n: > '" + (folder / "begun") +
                              "'\nsleep 2 & wait\ncat > \"$word\"\n");
  around.launcher = {"/usr/bin/setsid"};  // a group of processes, as a terminal makes one
  const std::string model = folder / "balls.ply";
  write_file(model, ply_file(3));
  // More bytes than wait in a channel.
  RunningProgram program({"render", model, "--orbit", "9", "--width", "400", "--height", "400",
                          "-q", "--video", folder / "out.mp4"},
                         around);
  for (int i = 0; i < 600 && !fs::exists(folder / "begun"); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  REQUIRE(fs::exists(folder / "begun"));
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  REQUIRE(::kill(-program.process(), SIGINT) == 0);
  const Outcome outcome = program.wait();
  INFO(outcome.err);
  CHECK(outcome.code == 130);
  CHECK(!fs::exists(folder / "out.mp4"));
  for (const auto& entry : fs::directory_iterator(fs::path(folder / "")))
    CHECK(entry.path().extension() != ".mp4");
}

TEST_CASE("what ffmpeg says when it fails is told, and no file is left") {
  const TemporaryFolder folder;
  for (const char* body : {"echo 'Unknown encoder libx264' >&2; exit 8\n",
                           "cat > /dev/null; echo 'Unknown encoder libx264' >&2; exit 8\n"}) {
    const Outcome outcome = raysplats_program(
        orbit(folder, "2") + Words{"--video", folder / "out.mp4"}, with_ffmpeg(folder, body));
    INFO(outcome.err);
    CHECK(outcome.code == 1);
    CHECK(outcome.err.find("Unknown encoder libx264") != std::string::npos);
    CHECK(!fs::exists(folder / "out.mp4"));
  }
  fs::remove_all(fs::path(folder / "bin"));
  const Outcome outcome = raysplats_program(
      orbit(folder, "2") + Words{"--video", folder / "a.webm"}, {{{"PATH", folder / "bin"}}});
  CHECK(outcome.code == 2);
  CHECK(outcome.err.find("apt-get install ffmpeg") != std::string::npos);
  CHECK(raysplats_program(orbit(folder, "2") + Words{"--video", folder / "a.avi"}).code == 2);
}

TEST_CASE("GIF and APNG need no program and hold every frame") {
  const TemporaryFolder folder;
  const Words command = orbit(folder, "4") + Words{"--fps", "25"};
  REQUIRE(raysplats_program(command + Words{"--video", folder / "a.apng", "-o", folder / "frames"})
              .code == 0);
  CHECK(fs::exists(folder / "frames/frame_0003.png"));
  const std::string png = read_file(folder / "a.apng");
  REQUIRE(png.starts_with("\x89PNG\r\n\x1a\n"));
  // The chunks one after the other: an animation of four frames of 40 ms, numbered in order.
  std::size_t frames = 0;
  std::uint32_t number = 0;
  std::string last;
  for (std::size_t at = 8; at + 12 <= png.size();) {
    const std::uint32_t size = big_endian(png, at);
    last = png.substr(at + 4, 4);
    const std::size_t data = at + 8;
    if (last == "IHDR") {
      CHECK(big_endian(png, data) == 33);
      CHECK(big_endian(png, data + 4) == 24);
    } else if (last == "acTL") {
      CHECK(big_endian(png, data) == 4);
    } else if (last == "fcTL") {
      ++frames;
      CHECK(big_endian(png, data) == number++);
      CHECK(png.substr(data + 20, 4) == std::string("\x00\x28\x03\xe8", 4));  // 40 / 1000 s
    } else if (last == "fdAT") {
      CHECK(big_endian(png, data) == number++);
    }
    at = data + size + 4;
  }
  CHECK(last == "IEND");
  CHECK(frames == 4);
  REQUIRE(raysplats_program(command + Words{"--video", folder / "a.gif"}).code == 0);
  const std::string gif = read_file(folder / "a.gif");
  CHECK(gif.starts_with("GIF89a"));
  CHECK(gif.find("NETSCAPE2.0") != std::string::npos);
  CHECK(static_cast<std::uint8_t>(gif.back()) == 0x3b);
  CHECK(lengths_of(gif) == std::vector<int>{4, 4, 4, 4});
}

TEST_CASE("a GIF lasts as long as its frames, and is whole or not there") {
  const TemporaryFolder folder;
  const auto lengths = [&](const std::string& frames, const std::string& fps) {
    REQUIRE(raysplats_program(orbit(folder, frames) +
                              Words{"--video", folder / "a.gif", "--fps", fps, "--overwrite"})
                .code == 0);
    return lengths_of(read_file(folder / "a.gif"));
  };
  CHECK(lengths("6", "30") == std::vector<int>{3, 4, 3, 3, 4, 3});
  CHECK(lengths("4", "40") == std::vector<int>{3, 2, 3, 2});
  CHECK(raysplats_program(orbit(folder, "2") + Words{"--video", folder / "b.gif", "--fps", "60"})
            .code == 2);
  // The encoder does not notice a full disk.
  Surroundings around;
  around.file_size_limit = 4096;
  around.full_once = [&] {
    for (const auto& entry : fs::directory_iterator(folder.path())) {
      std::error_code gone;
      if (entry.path().filename().string().starts_with(".full") &&
          fs::file_size(entry.path(), gone) > 0 && !gone)
        return true;
    }
    return false;
  };
  const Outcome outcome =
      raysplats_program(orbit(folder, "600") + Words{"--video", folder / "full.gif"}, around);
  CHECK(outcome.code == 3);
  CHECK(outcome.err.find("full disk") != std::string::npos);
  CHECK(!fs::exists(folder / "full.gif"));
}

TEST_CASE("sizes that the format cannot hold are refused before a device is asked for") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(3));
  const auto refused = [&](const Words& size, const Words& output, const std::string& part) {
    const Words command{"render", folder / "balls.ply", "--orbit", "2", "-q", "--device", "none"};
    const Outcome outcome = raysplats_program(command + size + output);
    INFO(outcome.err);
    CHECK(outcome.code == 2);
    CHECK(one_sentence(outcome));
    CHECK(outcome.err.find(part) != std::string::npos);
    CHECK(entries(folder.path()) == 1);
  };
  const Words wide{"--width", "70000", "--height", "2"};
  const Words high{"--width", "2", "--height", "1048576"};
  const std::string video = folder / "a";
  refused(wide, {"--video", video + ".gif"}, "GIF has at most 65535 a side");
  refused(wide, {"--video", video + ".mp4"}, "H.264 has at most 16384 a side");
  refused(high, {"--video", video + ".apng"}, "APNG has at most 1000000 a side");
  refused(wide, {"-o", video, "--format", "jpg"}, "JPEG has at most 65500 a side");
  refused(high, {"-o", video}, "PNG has at most 1000000 a side");
}

TEST_CASE("names of videos are no options and no addresses to ffmpeg") {
  const TemporaryFolder folder;
  Surroundings around =
      with_ffmpeg(folder, "echo \"$word\" > '" + (folder / "word") + "'; cat > \"$word\"\n");
  around.folder = folder.path();
  for (const std::string video : {"a:b/out.webm", "-x/out.webm"}) {
    REQUIRE(raysplats_program(orbit(folder, "2") + Words{"--video=" + video}, around).code == 0);
    CHECK(read_file(folder / "word").starts_with("/"));
    CHECK(fs::exists(folder / video));
  }
}

TEST_CASE("motion blur is the mean of the moments, and one moment is the frame itself") {
  const TemporaryFolder folder;
  const auto frames = [&](const std::string& name, const Words& more) {
    const Outcome outcome =
        raysplats_program(orbit(folder, "6") + Words{"-o", folder / name} + more);
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    return read_file(folder / (name + "/frame_0002.png"));
  };
  const std::string sharp = frames("sharp", {});
  CHECK(frames("one", {"--shutter-samples", "1"}) == sharp);
  CHECK(frames("many", {"--shutter-samples", "4", "--shutter", "1"}) != sharp);
}
