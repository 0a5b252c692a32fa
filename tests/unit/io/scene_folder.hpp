// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <glm/geometric.hpp>
#include <string>

#include "io/scene/scene_file.hpp"
#include "unit/io/scratch.hpp"

namespace raysplats::test {

/// A folder with the files that scenes name; their content matters to the loader alone.
class SceneFolder {
 public:
  SceneFolder() {
    for (const char* name : {"model.ply", "cube.obj", "wood.png", "sky.exr"}) {
      write_bytes(scratch_ / name, "x");
    }
  }
  SceneFile read(const std::string& text) const {
    write_bytes(path(), text);
    return read_scene_file(path());
  }
  /// The message of the error, which has to be of type E.
  template <class E>
  std::string refused(const std::string& text) const {
    try {
      read(text);
    } catch (const E& error) {
      return error.what();
    }
    return "";
  }
  fs::path path() const { return scratch_ / "scene.toml"; }
  const Scratch& scratch() const { return scratch_; }

 private:
  Scratch scratch_;
};

inline const std::string kModel = "[[model]]\nfile = 'model.ply'\n";
inline const std::string kMesh = "[[mesh]]\nfile = 'cube.obj'\n";

inline bool near(const glm::dvec3& a, const glm::dvec3& b) { return glm::length(a - b) < 1e-9; }

}  // namespace raysplats::test
