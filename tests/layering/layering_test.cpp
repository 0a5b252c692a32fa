// SPDX-License-Identifier: Apache-2.0
// The order of the modules, which is that of CMakeLists.txt, against the includes of sources,
// kernels and tests; and what is private stays private.
#include <doctest/doctest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "build_paths.hpp"

namespace fs = std::filesystem;

// Of consumer.cpp: the headers that whoever links the library can include.
extern const char* const kConsumerSees;

namespace {

using Names = std::set<std::string>;

struct Modules {
  /// What each may include directly besides itself, which is what it is linked with; whatever these
  /// may include it may too.
  std::map<std::string, Names> below;
  /// "A on B" where B is none of those that were made before A.
  Names upwards;
};

Modules read_modules(const fs::path& root) {
  Modules out;
  std::ifstream stream(root / "CMakeLists.txt");
  const std::string text(std::istreambuf_iterator<char>(stream), {});
  const std::regex call("raysplats_module\\((\\w+) DEPENDS([^)]*)\\)"), name("raysplats_(\\w+)");
  const std::sregex_iterator end;
  for (std::sregex_iterator found(text.begin(), text.end(), call); found != end; ++found) {
    const std::string module = (*found)[1], depends = (*found)[2];
    Names names;
    for (std::sregex_iterator at(depends.begin(), depends.end(), name); at != end; ++at) {
      const std::string other = (*at)[1];
      if (!out.below.contains(other)) out.upwards.insert(module + " on " + other);
      names.insert(other);
    }
    out.below[module] = names;
  }
  // Files of scripts/cmake make these two.
  out.below["mpi"] = {"comm"};
  out.below["images"] = {"io"};
  return out;
}

const Modules kModules = read_modules(raysplats::test::source_dir());
const std::map<std::string, Names>& kBelow = kModules.below;

/// The module that a public header is the face of.
const std::map<std::string, std::string> kFaces{
    {"error", "util"},          {"bounds", "scene"},    {"device", "device"},
    {"context", "device"},      {"camera", "scene"},    {"gaussians", "scene"},
    {"model_changes", "scene"}, {"image", "scene"},     {"rays", "scene"},
    {"trace_options", "scene"}, {"scene", "scene"},     {"pose_gradient", "scene"},
    {"mirrors", "scene"},       {"dataset", "io"},      {"io", "io"},
    {"model", "trace"},         {"tracer", "light"},    {"path_tracer", "light"},
    {"lpips", "eval"},          {"evaluation", "eval"}, {"evaluation_row", "run"},
    {"train_options", "run"},   {"trainer", "train"},   {"opencl", "light"},
    {"contributions", "light"}};

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
  const std::string end = file.extension().string();
  return end == ".hpp" || end == ".cpp" || end == ".h" || end == ".cl";
}

std::vector<fs::path> sources(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (is_source(entry.path())) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// The folder of `room` that a file lies in; of those right there, the file.
std::string folder_of(const fs::path& file, const fs::path& room) {
  return (*file.lexically_relative(room).begin()).string();
}

/// Collects one sentence for every include of a tree that points upwards or to what is private.
class Layers {
 public:
  explicit Layers(const fs::path& root) : root_(root) {
    read_host();
    read_public_headers();
    read_kernels();
    read_unit_tests();
    read_apps();
  }
  const std::vector<std::string>& faults() const { return faults_; }

 private:
  void complain(const fs::path& file, const std::string& include, const char* what) {
    faults_.push_back(file.lexically_relative(root_).generic_string() + " includes " + include +
                      ", " + what);
  }

  bool is_known(const fs::path& file, const std::string& module) {
    if (!kBelow.contains(module)) complain(file, module, "a module that no order is known of");
    return kBelow.contains(module);
  }

  void check(const fs::path& file, const std::string& include, const Names& reach) {
    const std::size_t slash = include.find('/');
    if (slash == std::string::npos) return;
    std::string target = include.substr(0, slash);
    if (target == "raysplats") {
      const auto face = kFaces.find(fs::path(include).stem().string());
      if (face == kFaces.end()) {
        complain(file, include, "a public header that no module is known of");
        return;
      }
      target = face->second;
    }
    if (!reach.contains(target)) complain(file, include, "which is above it");
  }

  void read_host() {
    for (const fs::path& file : sources(root_ / "host")) {
      const std::string module = folder_of(file, root_ / "host");
      if (!is_known(file, module)) continue;
      Names reach = reach_of(module);
      reach.insert("shared");
      for (const std::string& include : includes_of(file)) check(file, include, reach);
      if (module != "device") keep_from_opencl(file);
    }
  }

  void read_public_headers() {
    for (const fs::path& file : sources(root_ / "include/raysplats")) {
      const auto own = kFaces.find(file.stem().string());
      if (own == kFaces.end()) {
        complain(file, "nothing yet", "but no module is known of it");
        continue;
      }
      for (const std::string& include : includes_of(file)) {
        if (include.starts_with("raysplats/")) {
          check(file, include, reach_of(own->second));
        } else {
          complain(file, include, "which is private");
        }
      }
    }
  }

  /// Kernels lie in the folders of the modules that launch them.
  void read_kernels() {
    for (const fs::path& file : sources(root_ / "cl")) {
      const std::string folder = folder_of(file, root_ / "cl");
      const bool shared = folder == "shared";
      if (!shared && !is_known(file, folder)) continue;
      Names reach = shared ? Names() : reach_of(folder);
      reach.insert("shared");
      for (const std::string& include : includes_of(file)) check(file, include, reach);
    }
  }

  /// Tests of a module know the reference and make data sets besides; "unit" is what tests share.
  void read_unit_tests() {
    const fs::path room = root_ / "tests/unit";
    for (const fs::path& file : sources(room)) {
      if (file.parent_path() == room || !is_known(file, folder_of(file, room))) continue;
      Names reach = reach_of(folder_of(file, room));
      reach.merge(Names{"reference", "synth", "shared", "unit"});
      for (const std::string& include : includes_of(file)) check(file, include, reach);
    }
  }

  /// Nothing is above programs; examples see what an installed package has.
  void read_apps() {
    for (const fs::path& file : sources(root_ / "apps")) {
      keep_from_opencl(file);
      if (folder_of(file, root_ / "apps") != "examples") continue;
      for (const std::string& include : includes_of(file))
        complain(file, include, "which is private");
    }
  }

  void keep_from_opencl(const fs::path& file) {
    for (const std::string& include : includes_of(file)) {
      if (include == "device/cl.hpp") complain(file, include, "which is for host/device alone");
    }
  }

  fs::path root_;
  std::vector<std::string> faults_;
};

/// A tree of two files with an include each.
class Tree {
 public:
  Tree(const std::string& file, const std::string& include)
      : root_(fs::temp_directory_path() / ("raysplats_layering_" + std::to_string(counter_++))) {
    for (const char* folder : {"host", "include/raysplats", "cl", "tests/unit", "apps"})
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
  std::vector<std::string> faults() const { return Layers(root_).faults(); }

 private:
  static inline int counter_ = 0;
  fs::path root_;
};

}  // namespace

TEST_CASE("the order of the modules is read from the build") {
  CHECK(kBelow.size() > 20);
  CHECK(kModules.upwards == Names{});
  CHECK(kBelow.at("util").empty());
  CHECK(kBelow.at("scene") == Names{"util"});
  CHECK(!kBelow.at("trace").contains("io"));
  CHECK(kBelow.at("io") == Names{"scene"});  // over several lines
  CHECK(kBelow.at("bench") == Names{"train", "synth", "reference"});
}

TEST_CASE("dependencies point one way, and public headers include public headers") {
  const fs::path root = raysplats::test::source_dir();
  REQUIRE(sources(root / "host").size() > 100);
  REQUIRE(sources(root / "cl").size() > 80);
  REQUIRE(sources(root / "tests/unit").size() > 150);
  const Layers layers(root);
  for (const std::string& fault : layers.faults()) FAIL_CHECK(fault);
}

TEST_CASE("who links the library sees its public headers alone") {
  CHECK(std::string(kConsumerSees) == "public");
}

TEST_CASE("an arrow upwards and a private header in a public one are found") {
  CHECK(Tree("host/trace/a.cpp", "bvh/lbvh.hpp").faults().empty());
  CHECK(Tree("host/trace/a.cpp", "raysplats/model.hpp").faults().empty());
  CHECK(Tree("include/raysplats/trainer.hpp", "raysplats/context.hpp").faults().empty());
  CHECK(Tree("host/trace/a.cpp", "light/view_tracer.hpp").faults().size() == 1);
  CHECK(Tree("host/bvh/a.hpp", "raysplats/trainer.hpp").faults().size() == 1);
  CHECK(Tree("host/io/a.hpp", "device/context.hpp").faults().size() == 1);
  CHECK(Tree("host/new/a.hpp", "util/rng.hpp").faults().size() == 1);
  CHECK(Tree("host/trace/a.hpp", "device/cl.hpp").faults().size() == 1);
  CHECK(Tree("include/raysplats/context.hpp", "device/cl.hpp").faults().size() == 1);
  CHECK(Tree("include/raysplats/camera.hpp", "raysplats/model.hpp").faults().size() == 1);
  CHECK(Tree("include/raysplats/unheard_of.hpp", "raysplats/error.hpp").faults().size() == 1);
  CHECK(Tree("cl/trace/a.cl", "bvh/box.h").faults().empty());
  CHECK(Tree("cl/trace/a.cl", "shared/sh.h").faults().empty());
  CHECK(Tree("cl/bvh/a.cl", "trace/packet.h").faults().size() == 1);
  CHECK(Tree("cl/shared/a.h", "bvh/box.h").faults().size() == 1);
  CHECK(Tree("cl/new/a.cl", "shared/sh.h").faults().size() == 1);
  CHECK(Tree("tests/unit/trace/a_test.cpp", "bvh/lbvh.hpp").faults().empty());
  CHECK(Tree("tests/unit/trace/a_test.cpp", "reference/tracer.hpp").faults().empty());
  CHECK(Tree("tests/unit/trace/a_test.cpp", "train/adam.hpp").faults().size() == 1);
  CHECK(Tree("apps/raysplats/a.cpp", "train/adam.hpp").faults().empty());
  CHECK(Tree("apps/raysplats/a.cpp", "device/cl.hpp").faults().size() == 1);
  CHECK(Tree("apps/examples/a.cpp", "train/adam.hpp").faults().size() == 1);
}
