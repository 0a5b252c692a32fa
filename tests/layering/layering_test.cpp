// SPDX-License-Identifier: Apache-2.0
// The order of the modules in docs/architecture.md, read off the includes.
#include <doctest/doctest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace fs = std::filesystem;

namespace {

using Names = std::set<std::string>;

/// What each module may include directly besides itself; whatever these may include it may too.
const std::map<std::string, Names> kBelow{{"base", {}},
                                          {"core", {"base"}},
                                          {"comm", {"base"}},
                                          {"mpi", {"comm"}},
                                          {"device", {"base"}},
                                          {"primitives", {"device"}},
                                          {"bvh", {"primitives"}},
                                          {"trace", {"bvh", "core"}},
                                          {"light", {"trace"}},
                                          {"io", {"core"}},
                                          {"images", {"io"}},
                                          {"eval", {"io", "light", "comm"}},
                                          {"train", {"eval"}},
                                          {"view", {"train"}},
                                          {"prepare", {"io"}},
                                          {"synth", {"io"}},
                                          {"bench", {"train", "synth", "reference"}},
                                          {"report", {"bench"}},
                                          {"reference", {"core"}}};

/// The module that a public header is the face of.
const std::map<std::string, std::string> kFaces{
    {"error", "base"},         {"device", "device"},
    {"context", "device"},     {"camera", "core"},
    {"gaussians", "core"},     {"model_changes", "core"},
    {"image", "core"},         {"rays", "core"},
    {"trace_options", "core"}, {"scene", "core"},
    {"pose_gradient", "core"}, {"mirrors", "core"},
    {"dataset", "io"},         {"io", "io"},
    {"model", "trace"},        {"tracer", "light"},
    {"path_tracer", "light"},  {"lpips", "eval"},
    {"evaluation", "eval"},    {"train_options", "train"},
    {"trainer", "train"},      {"opencl", "light"}};

Names reach_of(const std::string& module) {
  Names reach{module};
  for (const std::string& below : kBelow.at(module)) reach.merge(reach_of(below));
  return reach;
}

std::vector<std::string> includes_of(const fs::path& file) {
  std::vector<std::string> found;
  std::ifstream stream(file);
  const std::string start = "#include \"";
  for (std::string line; std::getline(stream, line);) {
    if (!line.starts_with(start)) continue;
    found.push_back(line.substr(start.size(), line.find('"', start.size()) - start.size()));
  }
  return found;
}

bool is_source(const fs::path& file) {
  return file.extension() == ".hpp" || file.extension() == ".cpp";
}

std::vector<fs::path> sources(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (is_source(entry.path())) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// One sentence for every include of a tree that points upwards or out of the public headers.
std::vector<std::string> faults(const fs::path& root) {
  std::vector<std::string> out;
  const auto complain = [&](const fs::path& file, const std::string& include, const char* what) {
    out.push_back(file.lexically_relative(root).generic_string() + " includes " + include + ", " +
                  what);
  };
  for (const fs::path& file : sources(root / "host")) {
    const std::string module = (*file.lexically_relative(root / "host").begin()).string();
    if (!kBelow.contains(module)) {
      complain(file, module, "a module that no order is known of");
      continue;
    }
    const Names reach = reach_of(module);
    for (const std::string& include : includes_of(file)) {
      const std::size_t slash = include.find('/');
      std::string target = include.substr(0, slash);
      if (slash == std::string::npos || target == "shared") continue;
      if (target == "raysplats") {
        const auto face = kFaces.find(fs::path(include).stem().string());
        if (face == kFaces.end()) {
          complain(file, include, "a public header that no module is known of");
          continue;
        }
        target = face->second;
      }
      if (!reach.contains(target)) complain(file, include, "which is above it");
    }
  }
  for (const fs::path& file : sources(root / "include/raysplats")) {
    const auto own = kFaces.find(file.stem().string());
    if (own == kFaces.end()) {
      complain(file, "nothing yet", "but no module is known of it");
      continue;
    }
    for (const std::string& include : includes_of(file)) {
      if (!include.starts_with("raysplats/")) {
        complain(file, include, "which is private");
        continue;
      }
      const auto face = kFaces.find(fs::path(include).stem().string());
      if (face == kFaces.end() || !reach_of(own->second).contains(face->second))
        complain(file, include, "which is above it");
    }
  }
  // What the device alone may know.
  for (const fs::path& file : sources(root / "host")) {
    const std::string module = (*file.lexically_relative(root / "host").begin()).string();
    for (const std::string& include : includes_of(file)) {
      if (include == "device/cl.hpp" && module != "device")
        complain(file, include, "which is for host/device alone");
    }
  }
  return out;
}

/// A tree of two files with an include each.
class Tree {
 public:
  Tree(const std::string& file, const std::string& include)
      : root_(fs::temp_directory_path() / ("raysplats_layering_" + std::to_string(counter_++))) {
    for (const char* folder : {"host/base", "include/raysplats"})
      fs::create_directories(root_ / folder);
    fs::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << "#include <vector>\n#include \"" << include << "\"\n";
  }
  ~Tree() {
    std::error_code error;
    fs::remove_all(root_, error);
  }
  Tree(const Tree&) = delete;
  Tree& operator=(const Tree&) = delete;
  std::vector<std::string> faults() const { return ::faults(root_); }

 private:
  static inline int counter_ = 0;
  fs::path root_;
};

}  // namespace

TEST_CASE("dependencies point one way, and public headers include public headers") {
  const fs::path root = RAYSPLATS_SOURCE_DIR;
  REQUIRE(sources(root / "host").size() > 100);
  for (const std::string& fault : faults(root)) FAIL_CHECK(fault);
}

TEST_CASE("an arrow upwards and a private header in a public one are found") {
  CHECK(Tree("host/trace/a.cpp", "bvh/lbvh.hpp").faults().empty());
  CHECK(Tree("host/trace/a.cpp", "raysplats/model.hpp").faults().empty());
  CHECK(Tree("include/raysplats/trainer.hpp", "raysplats/context.hpp").faults().empty());
  CHECK(Tree("host/trace/a.cpp", "light/view_tracer.hpp").faults().size() == 1);
  CHECK(Tree("host/bvh/a.hpp", "raysplats/trainer.hpp").faults().size() == 1);
  CHECK(Tree("host/io/a.hpp", "device/context.hpp").faults().size() == 1);
  CHECK(Tree("host/new/a.hpp", "base/rng.hpp").faults().size() == 1);
  CHECK(Tree("host/trace/a.hpp", "device/cl.hpp").faults().size() == 1);
  CHECK(Tree("include/raysplats/context.hpp", "device/cl.hpp").faults().size() == 1);
  CHECK(Tree("include/raysplats/camera.hpp", "raysplats/model.hpp").faults().size() == 1);
  CHECK(Tree("include/raysplats/unheard_of.hpp", "raysplats/error.hpp").faults().size() == 1);
}
