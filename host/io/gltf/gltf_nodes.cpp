// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/gltf_nodes.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec4.hpp>
#include <utility>
#include <vector>

namespace raysplats::io {
namespace {

constexpr const char* kInstancing = "EXT_mesh_gpu_instancing";

/// The nodes of the default scene, of the first one without a default, or all that are no
/// children.
std::vector<int> roots(const GltfReader& reader) {
  const tinygltf::Model& model = reader.model();
  if (!model.scenes.empty()) {
    const int scene = std::max(model.defaultScene, 0);
    if (static_cast<std::size_t>(scene) >= model.scenes.size()) {
      reader.fail(fmt::format("there is no scene {}", scene));
    }
    return model.scenes[static_cast<std::size_t>(scene)].nodes;
  }
  std::vector<bool> is_child(model.nodes.size(), false);
  for (const tinygltf::Node& node : model.nodes) {
    for (const int child : node.children) {
      if (child >= 0 && static_cast<std::size_t>(child) < is_child.size()) {
        is_child[static_cast<std::size_t>(child)] = true;
      }
    }
  }
  std::vector<int> result;
  for (std::size_t i = 0; i < is_child.size(); ++i) {
    if (!is_child[i]) result.push_back(static_cast<int>(i));
  }
  return result;
}

glm::dmat4 local(const GltfReader& reader, const tinygltf::Node& node, int number) {
  const auto check = [&](const char* what, const std::vector<double>& values, std::size_t size) {
    if (!values.empty() && values.size() != size) {
      reader.fail(fmt::format("the {} of the node {} has {} numbers, not {}", what, number,
                              values.size(), size));
    }
    return !values.empty();
  };
  glm::dmat4 matrix(1.0);
  if (check("matrix", node.matrix, 16)) {
    for (int i = 0; i < 16; ++i) matrix[i / 4][i % 4] = node.matrix[static_cast<std::size_t>(i)];
    if (glm::dvec4(matrix[0][3], matrix[1][3], matrix[2][3], matrix[3][3]) !=
        glm::dvec4(0.0, 0.0, 0.0, 1.0)) {
      reader.fail(
          fmt::format("the matrix of the node {} has another last row than 0 0 0 1", number));
    }
    return matrix;
  }
  if (check("rotation", node.rotation, 4)) {
    const glm::dquat q(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]);
    if (!(glm::length(q) > 0.0)) {
      reader.fail(fmt::format("the rotation of the node {} is zero", number));
    }
    matrix = glm::mat4_cast(glm::normalize(q));
  }
  if (check("scale", node.scale, 3)) {
    for (int i = 0; i < 3; ++i) matrix[i] *= node.scale[static_cast<std::size_t>(i)];
  }
  if (check("translation", node.translation, 3)) {
    matrix[3] = glm::dvec4(node.translation[0], node.translation[1], node.translation[2], 1.0);
  }
  return matrix;
}

}  // namespace

void for_each_placed_mesh(const GltfReader& reader,
                          const std::function<void(int mesh, const glm::dmat4& matrix)>& place) {
  const tinygltf::Model& model = reader.model();
  const auto checked = [&](int mesh, const glm::dmat4& matrix) {
    if (mesh < 0 || static_cast<std::size_t>(mesh) >= model.meshes.size()) {
      reader.fail(fmt::format("there is no mesh {}", mesh));
    }
    place(mesh, matrix);
  };
  if (model.nodes.empty()) {
    for (std::size_t i = 0; i < model.meshes.size(); ++i) {
      checked(static_cast<int>(i), glm::dmat4(1.0));
    }
  }
  std::vector<std::pair<int, glm::dmat4>> open;
  for (const int root : roots(reader)) open.emplace_back(root, glm::dmat4(1.0));
  std::vector<bool> seen(model.nodes.size(), false);
  bool copies_left_out = false;
  while (!open.empty()) {
    const auto [number, parent] = open.back();
    open.pop_back();
    if (number < 0 || static_cast<std::size_t>(number) >= model.nodes.size()) {
      reader.fail(fmt::format("there is no node {}", number));
    }
    // Nodes are a forest; anything else would never end, or grow without bounds.
    if (seen[static_cast<std::size_t>(number)]) {
      reader.fail(fmt::format("the node {} has two parents", number));
    }
    seen[static_cast<std::size_t>(number)] = true;
    const tinygltf::Node& node = model.nodes[static_cast<std::size_t>(number)];
    const glm::dmat4 matrix = parent * local(reader, node, number);
    if (node.mesh >= 0) {
      copies_left_out = copies_left_out || node.extensions.count(kInstancing) > 0;
      checked(node.mesh, matrix);
    }
    for (const int child : node.children) open.emplace_back(child, matrix);
  }
  if (copies_left_out) {
    spdlog::warn(
        "{}: the copies of {} are left out: each of these meshes stands once, where its "
        "node is",
        reader.path().string(), kInstancing);
  }
}

}  // namespace raysplats::io
