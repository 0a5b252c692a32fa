// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/mat4x4.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/gltf/gltf_document.hpp"
#include "io/gltf/gltf_model.hpp"
#include "io/gltf/gltf_nodes.hpp"
#include "io/model/broken_gaussians.hpp"
#include "io/model/gaussian_codes.hpp"
#include "io/model/gltf_gaussians.hpp"
#include "io/model/model_formats.hpp"
#include "raysplats/error.hpp"
#include "scene/gaussians/gaussian_transform.hpp"

namespace raysplats::io {
namespace {

/// Nodes may show a mesh again, but a small file is not to ask for all memory that way.
constexpr std::size_t kMostCopies = 64;

const tinygltf::Value* splatting(const tinygltf::Primitive& primitive) {
  const auto found = primitive.extensions.find(kSplattingExtension);
  return found == primitive.extensions.end() ? nullptr : &found->second;
}

bool has_gaussians(const tinygltf::Mesh& mesh) {
  return std::any_of(mesh.primitives.begin(), mesh.primitives.end(),
                     [](const tinygltf::Primitive& each) { return splatting(each) != nullptr; });
}

/// Whether all attributes have numbers of their own, beside what an extension may pack.
bool is_whole(const GltfReader& reader, const tinygltf::Primitive& primitive) {
  for (const char* name : {"POSITION", kSplattingRotation, kSplattingScale, kSplattingOpacity}) {
    if (attribute(primitive, name) < 0) return false;
  }
  const auto& accessors = reader.model().accessors;
  return std::all_of(primitive.attributes.begin(), primitive.attributes.end(),
                     [&](const auto& named) {
                       const auto index = static_cast<std::size_t>(named.second);
                       return index >= accessors.size() || accessors[index].bufferView >= 0;
                     });
}

void check_kind(const GltfReader& reader, const tinygltf::Primitive& primitive) {
  const tinygltf::Value& extension = *splatting(primitive);
  const auto refuse = [&](const std::string& what) {
    throw DataError(fmt::format("{} has Gaussians {}, which is not supported: export it otherwise",
                                reader.path().string(), what));
  };
  if (extension.IsObject()) {
    const auto text = [&](const char* key, const char* known) {
      const tinygltf::Value& value = extension.Get(key);
      if (value.IsString() && value.Get<std::string>() != known)
        refuse(fmt::format("with the {} '{}'", key, value.Get<std::string>()));
    };
    text("kernel", "ellipse");
    text("colorSpace", "srgb_rec709_display");
    text("projection", "perspective");
    // Else they are there for readers that do not know the packed form.
    if (extension.Has("extensions") && !is_whole(reader, primitive)) {
      for (const std::string& name : extension.Get("extensions").Keys())
        refuse(fmt::format("packed by {}", name));
    }
  }
}

Gaussians read_primitive(const GltfReader& reader,
                         const tinygltf::Primitive& primitive,
                         bool drop_nonfinite) {
  check_kind(reader, primitive);
  if (primitive.mode != TINYGLTF_MODE_POINTS) reader.fail("Gaussians are not of the mode POINTS");
  if (primitive.indices >= 0) reader.fail("Gaussians have indices");
  std::size_t count = 0;
  BrokenGaussians broken;
  const auto numbers = [&](const std::string& name, std::size_t width) {
    const int accessor = attribute(primitive, name);
    if (accessor < 0) reader.fail(fmt::format("Gaussians have no {}", name));
    std::vector<float> values = reader.floats(accessor, width);
    if (name == "POSITION") count = values.size() / width;
    if (values.size() != width * count) {
      reader.fail(fmt::format("{} Gaussians have {} of {}", count, values.size() / width, name));
    }
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (!std::isfinite(values[i])) broken.add(i / width, name);
    }
    return values;
  };
  Gaussians model;
  model.means = numbers("POSITION", 3);
  // By any coefficient, so that one that is missing is told below.
  for (int degree = 1; degree <= kSplattingMaxDegree; ++degree) {
    for (int n = 0; n <= 2 * degree; ++n) {
      if (attribute(primitive, splatting_harmonic(degree, n)) >= 0) model.sh_degree = degree;
    }
  }
  model.resize(count);
  const std::vector<float> rotations = numbers(kSplattingRotation, 4);
  const std::vector<float> scales = numbers(kSplattingScale, 3);
  const std::vector<float> opacities = numbers(kSplattingOpacity, 1);
  for (std::size_t i = 0; i < count; ++i) {
    const float* xyzw = &rotations[4 * i];
    const float wxyz[4] = {xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
    const std::array<double, 4> unit = unit_quaternion(wxyz);
    for (std::size_t k = 0; k < 4; ++k) model.quaternions[4 * i + k] = static_cast<float>(unit[k]);
    for (std::size_t k = 0; k < 3; ++k) {
      const float scale = scales[3 * i + k];
      if (scale < 0.0f) {
        reader.fail(
            "a scale is negative, a logarithm perhaps, as splat-transform wrote them until June "
            "2026: write it again by a newer one");
      }
      model.log_scales[3 * i + k] = std::log(std::max(scale, kSplattingLeastScale));
    }
    model.opacities[i] = logit_of(static_cast<double>(opacities[i]));
  }
  const std::size_t stride = 3 * static_cast<std::size_t>(sh_coefficients(model.sh_degree));
  std::size_t coefficient = 0;
  for (int degree = 0; degree <= model.sh_degree; ++degree) {
    for (int n = 0; n <= 2 * degree; ++n, ++coefficient) {
      const std::vector<float> values = numbers(splatting_harmonic(degree, n), 3);
      for (std::size_t i = 0; i < count; ++i) {
        std::copy_n(&values[3 * i], 3, &model.sh[stride * i + 3 * coefficient]);
      }
    }
  }
  broken.settle(model, reader.path(), drop_nonfinite);
  return model;
}

}  // namespace

std::string splatting_harmonic(int degree, int n) {
  return fmt::format("KHR_gaussian_splatting:SH_DEGREE_{}_COEF_{}", degree, n);
}

glm::dmat4 splatting_turn() {
  glm::dmat4 turn(1.0);
  turn[0][0] = turn[1][1] = -1.0;
  return turn;
}

bool has_gltf_gaussians(const std::filesystem::path& path) {
  const tinygltf::Model model = parse_gltf(path);
  return std::any_of(model.meshes.begin(), model.meshes.end(), has_gaussians);
}

Gaussians read_gltf_gaussians(const std::filesystem::path& path, bool drop_nonfinite) {
  const tinygltf::Model file = parse_gltf(path);
  const GltfReader reader(file, path);
  std::vector<std::optional<Gaussians>> meshes(file.meshes.size());
  std::vector<std::pair<std::size_t, glm::dmat4>> places;
  std::size_t own = 0;
  std::size_t total = 0;
  for_each_placed_mesh(reader, [&](int number, const glm::dmat4& matrix) {
    const auto index = static_cast<std::size_t>(number);
    const tinygltf::Mesh& mesh = file.meshes[index];
    if (!has_gaussians(mesh)) return;
    if (!meshes[index]) {
      std::vector<Gaussians> parts;
      for (const tinygltf::Primitive& primitive : mesh.primitives) {
        if (splatting(primitive) != nullptr)
          parts.push_back(read_primitive(reader, primitive, drop_nonfinite));
      }
      meshes[index] = parts.size() == 1 ? std::move(parts.front()) : joined(parts);
      own += meshes[index]->size();
    }
    total += meshes[index]->size();
    places.emplace_back(index, matrix);
  });
  if (total > kMostCopies * own) {
    throw DataError(
        fmt::format("The nodes of {} show {} Gaussians, more than {} times the {} that it holds: "
                    "export it with fewer nodes that show the same mesh",
                    path.string(), total, kMostCopies, own));
  }
  std::vector<Gaussians> placed;
  for (const auto& [index, matrix] : places) {
    try {
      placed.push_back(transformed(*meshes[index], splatting_turn() * matrix));
    } catch (const UsageError& error) {
      reader.fail(error.what());
    }
  }
  if (placed.empty()) {
    throw DataError(fmt::format("{} is no 3D Gaussian model: no mesh of its scene has {}",
                                path.string(), kSplattingExtension));
  }
  return placed.size() == 1 ? std::move(placed.front()) : joined(placed);
}

}  // namespace raysplats::io
