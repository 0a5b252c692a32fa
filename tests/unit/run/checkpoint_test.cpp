// SPDX-License-Identifier: Apache-2.0
#include "run/checkpoint.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "raysplats/error.hpp"
#include "unit/temporary_directory.hpp"
#include "util/atomic_file.hpp"

using namespace raysplats;

namespace {

Checkpoint sample(std::int64_t iteration) {
  Checkpoint c;
  c.iteration = iteration;
  c.count = 3;
  c.seed = 18000000000000000000ull;
  c.optimiser_steps = 77;
  c.sh_degree = 2;
  c.active_sh_degree = 1;
  c.scale_activation = "exp";
  c.scene_extent = 0.1 + 0.2;
  c.dataset = "0123456789abcdef";
  c.split = "fedcba9876543210";
  c.bad_steps = 4;
  c.bad_steps_in_a_row = 2;
  c.skipped_updates = 11;
  c.views_joined = 6300;
  c.left_out_from = 3500;
  c.pass_due = true;
  c.config = "iterations = 5\n# \"quoted\"\n";
  c.sections["means"] = {1.5f, -0.0f, std::numeric_limits<float>::denorm_min(), std::nanf("7")};
  c.sections["empty"] = {};
  c.sections["sh"] = std::vector<float>(1000, 0.25f);
  return c;
}

}  // namespace

TEST_CASE("a checkpoint comes back bit for bit") {
  const TemporaryDirectory folder;
  const auto path = checkpoint_path(folder.path(), 7000);
  CHECK(path.filename() == "step_000007000.rsck");
  const Checkpoint c = sample(7000);
  write_checkpoint(path, c);
  const Checkpoint read = read_checkpoint(path);
  CHECK(read.iteration == 7000);
  CHECK(read.count == 3);
  CHECK(read.seed == c.seed);
  CHECK(read.optimiser_steps == 77);
  CHECK(read.sh_degree == 2);
  CHECK(read.active_sh_degree == 1);
  CHECK(read.scale_activation == "exp");
  CHECK(read.scene_extent == c.scene_extent);
  CHECK(read.dataset == c.dataset);
  CHECK(read.split == c.split);
  CHECK(read.bad_steps == 4);
  CHECK(read.bad_steps_in_a_row == 2);
  CHECK(read.skipped_updates == 11);
  CHECK(read.views_joined == 6300);
  CHECK(read.left_out_from == 3500);
  CHECK(read.pass_due);
  CHECK(read.config == c.config);
  REQUIRE(read.sections.size() == 3);
  for (const auto& [name, values] : c.sections) {
    REQUIRE(read.sections.at(name).size() == values.size());
    if (values.empty()) continue;
    CHECK(std::memcmp(read.sections.at(name).data(), values.data(),
                      values.size() * sizeof(float)) == 0);
  }
}

TEST_CASE("sections are made one behind the other while the file is written, which is the same") {
  const TemporaryDirectory folder;
  const Checkpoint c = sample(7);
  write_checkpoint(folder / "whole.rsck", c);
  std::vector<std::string> asked;
  CheckpointSections sections;
  for (const auto& each : c.sections) {
    sections[each.first] = [&asked, &each] {
      asked.push_back(each.first);
      return each.second;
    };
  }
  Checkpoint head = c;
  head.sections.clear();
  write_checkpoint(folder / "parts.rsck", head, sections);
  CHECK(read_bytes(folder / "parts.rsck") == read_bytes(folder / "whole.rsck"));
  CHECK(asked == std::vector<std::string>{"empty", "means", "sh"});

  // One that cannot be made leaves no file.
  sections["sh"] = []() -> std::vector<float> { throw DeviceError("lost"); };
  CHECK_THROWS_AS(write_checkpoint(folder / "lost.rsck", head, sections), DeviceError);
  CHECK(!std::filesystem::exists(folder / "lost.rsck"));
}

TEST_CASE("the configuration of a run is known from its newest checkpoint that has one") {
  const TemporaryDirectory folder;
  CHECK(checkpoint_config(folder.path()).empty());
  CHECK(checkpoint_config(folder / "none").empty());
  for (const std::int64_t iteration : {1, 2, 3}) {
    Checkpoint c = sample(iteration);
    c.config = "iterations = " + std::to_string(iteration) + "\n";
    write_checkpoint(checkpoint_path(folder.path(), iteration), c);
  }
  write_text_file(checkpoint_path(folder.path(), 3), "RSCKPT\r\n");
  CHECK(checkpoint_config(folder.path()) == "iterations = 2\n");
  CHECK(checkpoint_config(checkpoint_path(folder.path(), 1)) == "iterations = 1\n");
  CHECK_THROWS_AS(checkpoint_config(checkpoint_path(folder.path(), 3)), DataError);

  // Where it is of a run at all.
  CHECK(run_folder_of(folder.path()) == folder.path());
  CHECK(run_folder_of(checkpoint_path(folder.path(), 1)) == folder.path());
  std::filesystem::create_directories(folder / "kept");
  std::filesystem::copy_file(checkpoint_path(folder.path(), 1), folder / "kept/step.rsck");
  CHECK(!run_folder_of(folder / "kept/step.rsck").has_value());
}

TEST_CASE("every truncation and every flipped bit is noticed") {
  const TemporaryDirectory folder;
  const auto path = folder.path() / "c.rsck";
  Checkpoint c = sample(1);
  c.sections["sh"].resize(4);
  write_checkpoint(path, c);
  const std::string good = read_bytes(path);
  const auto rejected = [&](const std::string& content) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << content;
    try {
      read_checkpoint(path);
    } catch (const DataError&) {
      return true;
    }
    return false;
  };
  for (std::size_t length = 0; length < good.size(); ++length) {
    INFO("length " << length);
    REQUIRE(rejected(good.substr(0, length)));
  }
  for (std::size_t byte = 0; byte < good.size(); ++byte) {
    std::string bad = good;
    bad[byte] = static_cast<char>(bad[byte] ^ (1 << (byte % 8)));
    INFO("byte " << byte);
    REQUIRE(rejected(bad));
  }
  CHECK(rejected(good + "x"));
  CHECK(!rejected(good));
}

TEST_CASE("a file that is no checkpoint is said to be none, whatever its name and length") {
  const TemporaryDirectory folder;
  for (const char* name : {"notes.txt", "notes.rsck"}) {
    for (const char* content : {"", "mine", "a file that is longer than a checkpoint's preamble"}) {
      write_text_file(folder / name, content);
      std::string told;
      try {
        load_latest_checkpoint(folder / name);
      } catch (const DataError& error) {
        told = error.what();
      }
      INFO(told);
      CHECK(told.find(std::string(name) + " is not a raysplats checkpoint") != std::string::npos);
    }
  }
}

TEST_CASE("the newest valid checkpoint is found and old ones go") {
  const TemporaryDirectory folder;
  CHECK_THROWS_AS(load_latest_checkpoint(folder.path()), DataError);
  for (const std::int64_t iteration : {100, 200, 1000}) {
    write_checkpoint(checkpoint_path(folder.path(), iteration), sample(iteration));
  }
  CHECK(load_latest_checkpoint(folder.path()).iteration == 1000);
  CHECK(load_latest_checkpoint(checkpoint_path(folder.path(), 100)).iteration == 100);
  std::string bad = read_bytes(checkpoint_path(folder.path(), 1000));
  bad.back() = static_cast<char>(bad.back() + 1);
  write_text_file(checkpoint_path(folder.path(), 1000), bad);
  CHECK(load_latest_checkpoint(folder.path()).iteration == 200);
  remove_old_checkpoints(folder.path(), 2, 1000);
  CHECK(list_checkpoints(folder.path()).size() == 2);
  CHECK(!std::filesystem::exists(checkpoint_path(folder.path(), 100)));
  remove_old_checkpoints(folder.path(), 5, 1000);
  CHECK(list_checkpoints(folder.path()).size() == 2);
  // What lies beyond a run takes no place of its own.
  write_checkpoint(checkpoint_path(folder.path(), 300), sample(300));
  remove_old_checkpoints(folder.path(), 1, 300);
  CHECK(std::filesystem::exists(checkpoint_path(folder.path(), 300)));
  CHECK(std::filesystem::exists(checkpoint_path(folder.path(), 1000)));
  CHECK(!std::filesystem::exists(checkpoint_path(folder.path(), 200)));
}
