// SPDX-License-Identifier: Apache-2.0
#include "io/photo/repeated_photos.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>

#include <cstdint>
#include <string>

#include "raysplats/dataset.hpp"
#include "raysplats/io.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/log_capture.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

constexpr int kSide = 200;

std::string noise(std::uint64_t seed) {
  CounterRng random(seed, 0);
  std::string bytes(3 * kSide * kSide, ' ');
  for (char& byte : bytes) byte = static_cast<char>(random.below(256));
  return bytes;
}

/// A BMP, whose size its pixels alone decide.
std::string bmp(const std::string& pixels) {
  std::string out = "BM";
  for (const std::size_t field : {54 + pixels.size(), std::size_t{0}, std::size_t{54}})
    put(out, static_cast<std::uint32_t>(field));
  for (const int field : {40, kSide, kSide}) put(out, static_cast<std::uint32_t>(field));
  put<std::uint16_t>(out, 1);
  put<std::uint16_t>(out, 24);
  for (int i = 0; i < 6; ++i) put<std::uint32_t>(out, 0);
  return out + pixels;
}

void write_noise(const Scratch& scratch, const std::string& name, std::uint64_t seed) {
  const std::string pixels = noise(seed);
  if (name.ends_with(".bmp")) return write_bytes(scratch / name, bmp(pixels));
  Image image(kSide, kSide, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i)
    image.data[i] = static_cast<float>(static_cast<unsigned char>(pixels[i])) / 255.0f;
  write_image(scratch / name, image);
}

/// Photos named by letters, of which every eighth is held out.
Dataset loaded(const Scratch& scratch, const std::string& letters, const std::string& end) {
  std::string frames;
  for (std::size_t i = 0; i < letters.size(); ++i) {
    frames += fmt::format("{}{{\"file_path\": \"{}{}\", \"transform_matrix\": {}}}",
                          i > 0 ? ", " : "", letters[i], end, matrix_json(static_cast<int>(i)));
  }
  write_bytes(
      scratch / "transforms.json",
      fmt::format("{{\"w\": {0}, \"h\": {0}, \"fl_x\": 300, \"frames\": [{1}]}}", kSide, frames));
  return load_dataset(scratch.path());
}

void copy(const Scratch& scratch, const std::string& from, const std::string& to) {
  fs::copy_file(scratch / from, scratch / to, fs::copy_options::overwrite_existing);
}

}  // namespace

TEST_CASE("a copy of a held-out photo under another name is not trained on") {
  // Of files that differ in size, and of such that do not.
  for (const std::string end : {".png", ".bmp"}) {
    CAPTURE(end);
    const Scratch scratch;
    for (const char letter : std::string("abcd"))
      write_noise(scratch, letter + end, static_cast<std::uint64_t>(letter));
    {
      const LogCapture log;
      CHECK(loaded(scratch, "abcd", end).views.size() == 4);
      CHECK(log.lines() == 0);
    }
    copy(scratch, "a" + end, "b" + end);
    const LogCapture log;
    const Dataset dataset = loaded(scratch, "abcd", end);
    REQUIRE(dataset.views.size() == 3);
    CHECK(dataset.views[0].test);
    CHECK(dataset.views[1].camera.name == "c" + end);
    CHECK(log.contains("1 of 3 photos to train on are held out too"));
    CHECK(log.contains("b" + end + " under the name"));
    CHECK(log.lines() == 1);
  }
}

TEST_CASE("copies that are most of the photos are trained on, and make held-out ones worthless") {
  const Scratch scratch;
  write_noise(scratch, "a.png", 1);
  copy(scratch, "a.png", "b.png");
  const LogCapture log;
  CHECK(loaded(scratch, "ab", ".png").views.size() == 2);
  CHECK(log.contains("1 of 1 held-out photos are trained on as well"));
  CHECK(log.contains("says nothing of unseen views"));
  CHECK(log.lines() == 1);
}

TEST_CASE("copies of one side are told and kept") {
  const Scratch scratch;
  write_noise(scratch, "a.png", 1);
  write_noise(scratch, "b.png", 2);
  copy(scratch, "b.png", "c.png");
  const LogCapture log;
  CHECK(loaded(scratch, "abc", ".png").views.size() == 3);
  CHECK(log.contains("1 photo is in more than one frame"));
  CHECK(log.lines() == 1);
}

TEST_CASE("photos that differ in a single pixel, or show nothing, are no copies") {
  const Scratch scratch;
  std::string pixels = noise(1);
  for (const char* name : {"a.bmp", "b.bmp", "c.bmp"}) {
    ++pixels.front();
    write_bytes(scratch / name, bmp(pixels));
  }
  const LogCapture log;
  CHECK(loaded(scratch, "abc", ".bmp").views.size() == 3);
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"})
    write_image(scratch / name, Image(kSide, kSide, 3, 0.5f));
  CHECK(loaded(scratch, "abc", ".jpg").views.size() == 3);
  CHECK(log.lines() == 0);
}
