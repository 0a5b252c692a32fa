// SPDX-License-Identifier: Apache-2.0
#include "io/convert_model.hpp"

#include <fmt/format.h>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <utility>

#include "io/model_file.hpp"
#include "io/ply_options.hpp"
#include "raysplats/error.hpp"
#include "scene/gaussian_transform.hpp"
#include "scene/model_changes.hpp"
#include "util/atomic_file.hpp"

namespace raysplats {
namespace {

// What a translation may leave of the distance of an origin that it takes away.
constexpr double kLedBack = 0.01;

// What a file without the comments of our PLY does not say of a model.
std::string not_said(const std::array<double, 3>& origin,
                     const std::optional<TraceOptions>& trace) {
  std::string out;
  if (origin != std::array<double, 3>{}) {
    out += fmt::format(", positions count from {}, {}, {}, which is not said in the file",
                       origin[0], origin[1], origin[2]);
  }
  if (!trace) return out;
  if (!trace->sky.empty()) out += ", the sky behind the model is not said in the file";
  const std::string flags = io::flags_to_show(*trace);
  if (!flags.empty()) {
    out += fmt::format(", how it is shown is not said in the file: give {} to render it", flags);
  }
  return out;
}

glm::dvec3 origin_of(const std::filesystem::path& model) {
  const std::array<double, 3> origin = io::model_origin(model);
  return {origin[0], origin[1], origin[2]};
}

}  // namespace

Conversion convert_model(const std::filesystem::path& input,
                         const std::filesystem::path& output,
                         const ModelChanges& changes,
                         const ModelEncoding& encoding,
                         std::optional<TraceOptions> trace,
                         bool overwrite) {
  const io::ModelFormat format = io::output_format(output);
  check_output_file(output, overwrite, {input});
  Gaussians model = read_model(input, encoding);
  const std::size_t read = model.size();
  const int degree = model.sh_degree;
  const glm::dmat4 map = movement(changes);
  // Positions are their numbers in the file plus its origin, which scales and turns as they do.
  glm::dvec3 moved_origin = glm::dmat3(map) * origin_of(input);
  ModelChanges of_numbers = changes;
  // Else the numbers would be as far away as the origin, to the other side.
  const glm::dvec3 rest = moved_origin + changes.translate;
  if (glm::length(rest) < kLedBack * glm::length(moved_origin)) {
    of_numbers.translate = rest;
    moved_origin = glm::dvec3(0.0);
  }
  const std::array<double, 3> origin{moved_origin.x, moved_origin.y, moved_origin.z};
  for (std::size_t k = 0; of_numbers.crop && k < 3; ++k)
    of_numbers.crop->low[k] -= origin[k], of_numbers.crop->high[k] -= origin[k];
  const Gaussians result = changed(std::move(model), of_numbers);
  if (read > 0 && result.size() == 0) {
    throw UsageError(fmt::format(
        "None of the {} Gaussians of {} is left: choose a larger box or a smaller opacity", read,
        input.string()));
  }
  if (trace) {
    trace->sky = transformed(trace->sky, map);
    trace->near_depth *= static_cast<float>(changes.scale);
  }
  write_model(output, result, encoding, trace, origin);
  std::string losses = io::losses(format, result);
  const bool leaves_out = result.size() < read || result.sh_degree < degree;
  if (leaves_out && losses == io::kNoLoss) losses = "nothing but what was asked for is left out";
  const std::string unsaid = format == io::ModelFormat::kPly ? "" : not_said(origin, trace);
  if (!unsaid.empty() && losses == io::kNoLoss) losses = "no number of the Gaussians is changed";
  return {read, result.size(), result.sh_degree, losses + unsaid};
}

}  // namespace raysplats
