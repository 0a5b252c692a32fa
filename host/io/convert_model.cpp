// SPDX-License-Identifier: Apache-2.0
#include "io/convert_model.hpp"

#include <fmt/format.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/trigonometric.hpp>
#include <numbers>

#include "core/gaussian_transform.hpp"
#include "io/model_file.hpp"
#include "raysplats/error.hpp"

namespace raysplats {
namespace {

/// The shortest turn of `up` to -y.
glm::dmat4 uprighting(const glm::dvec3& up) {
  const double length = glm::length(up);
  if (!(length > 0.0) || !std::isfinite(length))
    throw UsageError("--up 0,0,0 is no direction: say which one is to be up");
  const glm::dvec3 goal(0.0, -1.0, 0.0);
  const glm::dvec3 from = up / length;
  const glm::dvec3 axis = glm::cross(from, goal);
  const double sine = glm::length(axis);
  const double cosine = glm::dot(from, goal);
  // Half a turn goes about x: left and right change places with no other axis than front and back.
  if (sine < 1e-9) {
    return cosine > 0.0 ? glm::dmat4(1.0)
                        : glm::rotate(glm::dmat4(1.0), std::numbers::pi, glm::dvec3(1, 0, 0));
  }
  return glm::rotate(glm::dmat4(1.0), std::atan2(sine, cosine), axis / sine);
}

glm::dmat4 movement(const ModelChanges& changes) {
  glm::dmat4 map = glm::translate(glm::dmat4(1.0), changes.translate);
  map = glm::rotate(map, glm::radians(changes.rotate_degrees.z), glm::dvec3(0, 0, 1));
  map = glm::rotate(map, glm::radians(changes.rotate_degrees.y), glm::dvec3(0, 1, 0));
  map = glm::rotate(map, glm::radians(changes.rotate_degrees.x), glm::dvec3(1, 0, 0));
  map = glm::scale(map, glm::dvec3(changes.scale));
  return changes.up ? map * uprighting(*changes.up) : map;
}

}  // namespace

Gaussians changed(const Gaussians& model, const ModelChanges& changes) {
  Gaussians out = changes.min_opacity ? with_opacity(model, *changes.min_opacity) : model;
  const glm::dmat4 map = movement(changes);
  if (map != glm::dmat4(1.0)) out = transformed(out, map);
  if (changes.crop) out = within(out, *changes.crop);
  if (changes.max_gaussians) out = most_contributing(out, *changes.max_gaussians);
  if (changes.sh_degree) out = with_sh_degree(out, *changes.sh_degree);
  return out;
}

Conversion convert_model(const std::filesystem::path& input,
                         const std::filesystem::path& output,
                         const ModelChanges& changes,
                         const ModelEncoding& encoding,
                         std::optional<TraceOptions> trace,
                         bool overwrite) {
  const io::ModelFormat format = io::output_format(output);
  std::error_code error;
  if (std::filesystem::equivalent(input, output, error)) {
    throw UsageError(
        fmt::format("{} is what is read: give another file to write", output.string()));
  }
  if (!overwrite && std::filesystem::exists(output, error)) {
    throw UsageError(
        fmt::format("{} is there already: give another name, or --overwrite", output.string()));
  }
  const Gaussians model = read_model(input, encoding);
  const Gaussians result = changed(model, changes);
  if (model.size() > 0 && result.size() == 0) {
    throw UsageError(fmt::format(
        "None of the {} Gaussians of {} is left: choose a larger box or a smaller opacity",
        model.size(), input.string()));
  }
  const std::array<double, 3> origin = io::model_origin(input);
  if (trace) trace->sky = transformed(trace->sky, movement(changes));
  write_model(output, result, encoding, trace, origin);
  std::string losses = io::losses(format, result);
  if (format != io::ModelFormat::kPly && origin != std::array<double, 3>{}) {
    losses += fmt::format(", positions count from {}, {}, {}, which is not said in the file",
                          origin[0], origin[1], origin[2]);
  }
  if (format != io::ModelFormat::kPly && trace && !trace->sky.empty())
    losses += ", the sky behind the model is not said in the file";
  return {model.size(), result.size(), result.sh_degree, losses};
}

}  // namespace raysplats
