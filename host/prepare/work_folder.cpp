// SPDX-License-Identifier: Apache-2.0
#include "prepare/work_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>

#include "raysplats/error.hpp"
#include "util/atomic_file.hpp"
#include "util/output_directory.hpp"
#include "util/program.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 4> kSteps{"images", "features", "matches", "model"};

fs::path made(const fs::path& data) {
  make_output_directory(data);
  return data;
}

}  // namespace

fs::path mark_of(const fs::path& data, const std::string& step) { return data / "prepare" / step; }

WorkFolder::WorkFolder(const fs::path& data, const PrepareWatch& watch)
    : data_(made(data)), lock_(data_ / ".lock"), watch_(watch) {
  make_output_directory(data_ / "prepare");
}

bool WorkFolder::due(const std::string& name, const std::string& settings) const {
  std::ifstream stream(mark_of(data_, name));
  const std::string before((std::istreambuf_iterator<char>(stream)), {});
  return !stream || before != settings;
}

void WorkFolder::step(const std::string& name,
                      const std::string& settings,
                      const std::function<void()>& action) {
  if (!due(name, settings)) return;
  forget(name);
  action();
  write_text_file(mark_of(data_, name), settings);
}

void WorkFolder::forget(const std::string& name) const {
  const auto from = std::find(kSteps.begin(), kSteps.end(), name);
  std::for_each(from, kSteps.end(), [&](const char* step) { fs::remove(mark_of(data_, step)); });
}

void WorkFolder::colmap(const std::vector<std::string>& arguments,
                        const std::string& step,
                        const std::function<void(std::string_view, std::size_t& done)>& count,
                        std::size_t total) {
  std::size_t done = 0;
  std::string trouble;
  run_program(
      find_program("colmap", "colmap"), arguments, log(),
      [&](std::string_view line) {
        if (trouble.empty() && line.find("SQLite error") != std::string_view::npos) trouble = line;
        count(line, done);
      },
      [&] { return !watch_(step, done, total); });
  // COLMAP 3.8 goes on without what its database could not take, as on a full disk.
  if (!trouble.empty()) {
    throw Error(ErrorCode::kRuntime,
                fmt::format("The database of colmap could not be written: {} (all it said is in "
                            "{})",
                            trouble, log().string()));
  }
}

std::string WorkFolder::colmap_help(const std::string& command) const {
  std::string text;
  try {
    run_program(find_program("colmap", "colmap"), {command, "-h"}, log(),
                [&](std::string_view line) { text.append(line) += '\n'; }, {});
  } catch (const Error&) {
    // Some versions end with an error after it; what else is wrong the command itself will say.
  }
  return text;
}

}  // namespace raysplats
