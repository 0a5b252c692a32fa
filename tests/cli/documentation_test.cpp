// SPDX-License-Identifier: Apache-2.0
// Every command and every TOML block of README.md and docs/*.md, as it stands there.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "build_paths.hpp"
#include "program.hpp"

namespace fs = std::filesystem;

namespace {

bool has(const Words& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

/// A block of code, indented by four spaces after an empty line or between fences.
struct Block {
  std::string document;
  std::string language;
  std::vector<std::string> lines;
};

std::vector<Block> blocks_of(const fs::path& document) {
  std::vector<Block> blocks;
  std::istringstream text(read_file(document));
  std::string line;
  bool fenced = false;
  bool after_text = false;
  bool indented = false;
  for (std::string more; std::getline(text, line);) {
    // A command goes on behind a backslash.
    while (line.ends_with('\\') && std::getline(text, more)) {
      line.pop_back();
      line += more.substr(std::min(more.size(), more.find_first_not_of(' ')));
    }
    if (line.starts_with("```")) {
      if (!fenced) blocks.push_back({document.filename().string(), line.substr(3), {}});
      fenced = !fenced;
      indented = false;
    } else if (fenced) {
      blocks.back().lines.push_back(line);
    } else if (line.starts_with("    ") && !after_text) {
      if (!indented) blocks.push_back({document.filename().string(), "", {}});
      indented = true;
      blocks.back().lines.push_back(line.substr(4));
    } else if (line.empty()) {
      if (indented) blocks.back().lines.emplace_back();
    } else {
      indented = false;
    }
    after_text = !line.empty() && !indented && !line.starts_with("```");
  }
  return blocks;
}

/// The words of a command as a shell sees them; comments are left out.
Words shell_words(const std::string& line) {
  Words words;
  std::string word;
  bool inside = false;
  char quote = 0;
  for (const char c : line) {
    if (quote != 0) {
      if (c == quote) {
        quote = 0;
      } else {
        word += c;
      }
    } else if (c == '\'' || c == '"') {
      quote = c;
      inside = true;
    } else if (c == ' ') {
      if (inside) words.push_back(word);
      word.clear();
      inside = false;
    } else if (c == '#' && !inside) {
      return words;
    } else {
      word += c;
      inside = true;
    }
  }
  if (inside) words.push_back(word);
  return words;
}

/// What is not run here, by the beginning of its line, and why.
const std::vector<std::pair<std::string, std::string>> kNotRun{
    {"./scripts/quickstart.sh", "builds the program and trains for minutes"},
    {"./scripts/test.sh", "builds the program and runs this test"},
    {"raysplats=build/", "names the program"},
    {"cmake --install", "tested by the test 'package'"},
    {"find_package(raysplats", "tested by the test 'package'"},
    {"target_link_libraries(program", "tested by the test 'package'"},
    {"raysplats::", "C++: apps/examples, tested by the test 'package'"},
    {"const raysplats::", "C++: apps/examples, tested by the test 'package'"},
    {"cmake -S apps/examples", "tested by the test 'package'"},
    {"./scripts/gpu_path.sh", "another build of the driver; run by scripts/ci.sh"},
    {"scripts/gpu_path.sh", "another build of the driver; run by scripts/ci.sh"},
    {"scripts/other_system.sh ", "installs another system"},
    {"scripts/implementations.sh", "downloads OpenCL implementations; run by scripts/ci.sh"},
    {"./scripts/gpu_compile.py", "downloads compilers; run by scripts/ci.sh"},
    {"scripts/gpu_compile.py", "downloads compilers; run by scripts/ci.sh"},
    {"./scripts/ci.sh", "downloads compilers"},
    {"raysplats eval model.ply --data garden --downscale 4 -o eval --lpips",
     "needs a network that the user supplies"},
    {"ctest --preset", "runs this test"},
    {"scripts/figures.sh", "measures for minutes; the test 'figures' compares its parts with docs"},
    {"scripts/ablation.sh", "trains for minutes; its plots: tests/report/pages_test.py"},
    {"scripts/quality/few_photos.py", "needs a capture of COLMAP"},
    {"scripts/quality/disturb.py", "needs Pillow; a data set stands in its place"},
    {"scripts/quality/export_lpips.py", "needs PyTorch, and weights that it downloads"},
    {"raysplats train DATA --downscale D --test-every 4", "its numbers stand below it"},
    {"scripts/reliability/fuzz.sh", "needs a build by clang and 20 minutes"},
    {"build/release/bin/fuzz_seeds", "writes into the source tree"},
    {"cmake --preset asan-ubsan", "another build"},
    {"raysplats prepare ", "needs COLMAP; tests/cli/prepare_test.cpp"},
    {"$raysplats prepare ", "needs COLMAP; tests/cli/prepare_test.cpp"},
    {"raysplats view ", "runs until it is ended; tests/view"},
    {"$raysplats view ", "runs until it is ended; tests/view"},
    {"mpirun ", "needs MPI; tests/ranks"},
    {"RUSTICL_ENABLE=", "needs another OpenCL platform"},
    {"pip install ", "downloads; scripts/test_python.sh does the same"},
    {"./scripts/test_python.sh", "builds the wheel; run by scripts/ci.sh"},
    {"chrt -f 1 ", "measures for minutes, before all other processes"},
};

bool listed(const std::string& line) {
  return std::any_of(kNotRun.begin(), kNotRun.end(),
                     [&](const auto& entry) { return line.starts_with(entry.first); });
}

void put(std::string& bytes, std::uint32_t value) {
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(value >> shift & 0xffu);
}

constexpr const char* kTetrahedron =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

/// A triangle as binary glTF.
std::string glb_file() {
  std::string json =
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"byteLength":36}],)"
      R"("bufferViews":[{"buffer":0,"byteLength":36}],"accessors":[{"bufferView":0,)"
      R"("componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}]})";
  json.resize((json.size() + 3) / 4 * 4, ' ');
  std::string binary;
  for (const std::uint32_t bits :
       {0u, 0u, 0u, 0x3f800000u, 0u, 0u, 0u, 0x3f800000u, 0u}) {  // 0 or 1
    put(binary, bits);
  }
  std::string out = "glTF";
  put(out, 2);
  put(out, static_cast<std::uint32_t>(12 + 8 + json.size() + 8 + binary.size()));
  put(out, static_cast<std::uint32_t>(json.size()));
  out += "JSON" + json;
  put(out, static_cast<std::uint32_t>(binary.size()));
  out += std::string("BIN\0", 4) + binary;
  return out;
}

constexpr const char* kTriangle =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
    "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 "
    "0 1 2\n";

/// A folder with everything that the documents name: data sets in place of garden and lego, models,
/// meshes and results.
class Place {
 public:
  Place() {
    for (const char* data : {"garden", "lego", "BOX"}) {
      run({"generate", data, "--size", "64", "--train-views", "4", "--test-views", "2"});
    }
    write_file(folder_ / "model.ply", ply_file(3));
    write_file(folder_ / "ball.obj", kTetrahedron);
    write_file(folder_ / "figure.ply", kTriangle);
    write_file(folder_ / "table.glb", glb_file());
    write_file(folder_ / "transforms.json",
               R"({"w":16,"h":16,"fl_x":16,"fl_y":16,"cx":8,"cy":8,"frames":[
                 {"transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,6],[0,0,0,1]]}]})");
    write_npy(folder_ / "rays.npy", "False", "(2, 6)", {0, 0, -6, 0, 0, 1, 1, 0, -6, 0, 0, 1});
    fs::create_directory_symlink(fs::path(raysplats::test::source_dir()) / "configs",
                                 folder_ / "configs");
    for (const char* name : {"garden", "lego"}) train(name);
    run({"bench", "--sizes", "1k", "--resolution", "16x16", "--repeat", "1", "--filter", "^adam",
         "--json", "a.json"});
    fs::copy(folder_ / "a.json", folder_ / "b.json");
  }

  void run(Words words) const {
    Surroundings here;
    here.folder = folder_.path().string();
    // `tune --reset` and `--clear-cache` are not for the cache of whoever runs this test.
    if (has(words, "--reset") || has(words, "--clear-cache")) {
      here.environment.emplace_back("XDG_CACHE_HOME", folder_ / "cache");
    }
    words.emplace_back("-q");
    const Outcome outcome = raysplats_program(words, here);
    std::string line;
    for (const std::string& word : words) line += word + " ";
    INFO(line);
    INFO(outcome.err);
    CHECK(outcome.code == 0);
  }
  void remove(const std::string& name) const { fs::remove_all(folder_ / name); }
  void write(const std::string& name, const std::string& text) const {
    write_file(folder_ / name, text);
  }
  void train(const std::string& name) const {
    run(shortened({"train", name, "-o", "runs/" + name, "--downscale", "4"}));
  }

  /// The same command with less to compute.
  Words shortened(Words words) const {
    const auto add = [&](const std::string& option, const std::string& value) {
      if (!has(words, option)) words.insert(words.end(), {option, value});
    };
    const std::string command = words.at(0);
    if (command == "train") {
      const bool resumed = has(words, "--resume");
      words.insert(words.end(), {"--init-count", "50"});
      // A run by time has no number of iterations.
      const auto time = std::find(words.begin(), words.end(), "--time");
      if (time != words.end()) {
        *std::next(time) = "4s";  // less may be too short on a busy machine
      } else {
        words.insert(words.end(), {"-n", resumed ? "3" : "2"});
      }
    } else if (command == "generate") {
      for (std::size_t i = 1; i < words.size(); ++i) {
        if (words[i - 1] == "--size") words[i] = std::string("16");
        if (words[i - 1].ends_with("-views")) words[i] = std::string("2");
      }
    } else if (command == "render") {
      const bool scene = has(words, "scene.toml");
      if (scene || has(words, "--orbit")) add("--width", "16");
      if (!scene && has(words, "--orbit")) add("--height", "16");
      if (scene && !has(words, "--frames")) add("--samples", "1");
    } else if (command == "bench" && (has(words, "--report") || has(words, "--kernels"))) {
      // Folders of kernels that a reader has.
      for (std::size_t i = 1; i < words.size(); ++i) {
        if (words[i - 1] == "--kernels" || words[i - 1] == "--against")
          words[i] = raysplats::test::source_dir() + "/cl";
        if (words[i - 1] == "--sizes") words[i] = std::string("1k");
      }
      add("--sizes", "1k");
      add("--resolution", "16x16");
      add("--repeat", "1");
      add("--filter", "^adam");
    } else if (command == "bench" && !has(words, "compare")) {
      words.emplace_back("--list");
    } else if (command == "tune" && !has(words, "--reset")) {
      for (std::size_t i = 1; i < words.size(); ++i) {
        if (words[i - 1] == "--size") words[i] = std::string("1k");
        if (words[i - 1] == "--resolution") words[i] = std::string("16x16");
      }
      add("--size", "1k");
      add("--resolution", "16x16");
      add("--repeat", "1");
      if (!has(words, "--dry-run")) words.emplace_back("--dry-run");
    }
    return words;
  }

 private:
  TemporaryFolder folder_;
};

/// Runs what stands in a document after `raysplats`; `measured` are the measurements made so far.
void run_command(const Place& place, const Words& words, std::set<Words>& measured) {
  const Words command = place.shortened(words);
  // What measures the device does not depend on what was run before: documents that name the same
  // command need it once.
  const bool measures =
      command.at(0) == "bench" || command.at(0) == "tune" || command.at(0) == "doctor";
  if (measures && !measured.insert(command).second) return;
  // Examples are alternatives: each finds the folders as a reader who tries it alone does.
  for (std::size_t i = 1; i < words.size(); ++i) {
    const bool fresh = words.at(0) != "train" || !has(words, "--resume");
    const bool output =
        words[i - 1] == "-o" || words[i - 1] == "--video" || words[i - 1] == "--report";
    if (output && fresh) place.remove(words[i]);
  }
  if (words.at(0) == "generate") place.remove(words.at(1));
  // Its output may be its second word.
  if (words.at(0) == "convert" && !words.at(2).starts_with("-")) place.remove(words.at(2));
  place.run(command);
}

}  // namespace

TEST_CASE("every command and TOML block of the documents is run") {
  const Place place;
  std::vector<fs::path> documents{fs::path(raysplats::test::source_dir()) / "README.md"};
  for (const auto& entry :
       fs::directory_iterator(fs::path(raysplats::test::source_dir()) / "docs")) {
    if (entry.path().extension() == ".md") documents.push_back(entry.path());
  }
  std::sort(documents.begin() + 1, documents.end());
  std::set<Words> measured;
  std::size_t commands = 0;
  std::size_t scenes = 0;
  for (const fs::path& document : documents) {
    for (const Block& block : blocks_of(document)) {
      INFO(block.document);
      if (block.language == "python") continue;  // run by tests/python/test_documents.py
      std::string toml;
      bool inside = false;  // of cat > NAME <<'END'
      std::string written;  // its NAME
      for (const std::string& line : block.lines) {
        INFO(line);
        if (block.language == "toml") {
          toml += line + "\n";
        } else if (inside) {
          inside = line != "END";
          if (inside) toml += line + "\n";
          if (!inside) place.write(written, toml);
        } else if (line.starts_with("cat > ") && line.ends_with(" <<'END'")) {
          written = line.substr(6, line.find(" <<") - 6);
          inside = true;
          toml.clear();
        } else if (line.empty() || listed(line)) {
          continue;
        } else if (line.starts_with("raysplats ") || line.starts_with("$raysplats ")) {
          Words words = shell_words(line);
          words.erase(words.begin());
          // Where the output goes is the shell's business.
          words.erase(std::find(words.begin(), words.end(), ">"), words.end());
          if (words.front() == "COMMAND") continue;
          run_command(place, words, measured);
          ++commands;
        } else if (block.document != "architecture.md" && block.language != "text") {
          // The others hold no commands.
          FAIL_CHECK("this line is neither run nor listed with its reason: " << line);
        }
      }
      if (block.language == "toml") {
        place.write("scene.toml", toml);
        run_command(place, {"render", "scene.toml", "-o", "frames"}, measured);
        ++scenes;
      }
    }
  }
  CHECK(commands > 30);
  CHECK(scenes >= 1);
}
