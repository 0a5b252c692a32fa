// SPDX-License-Identifier: Apache-2.0
#include "io/convert_model.hpp"

#include <fmt/format.h>

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>

#include "io/model_file.hpp"
#include "io/ply_options.hpp"
#include "raysplats/error.hpp"
#include "scene/gaussian_transform.hpp"
#include "scene/model_changes.hpp"

namespace raysplats {
namespace {

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
  const glm::dmat4 map = movement(changes);
  // Positions are their numbers in the file plus its origin, which scales and turns as they do.
  const glm::dvec3 moved_origin = glm::dmat3(map) * origin_of(input);
  const std::array<double, 3> origin{moved_origin.x, moved_origin.y, moved_origin.z};
  ModelChanges of_numbers = changes;
  if (of_numbers.crop) of_numbers.crop->low -= moved_origin, of_numbers.crop->high -= moved_origin;
  const Gaussians result = changed(model, of_numbers);
  if (model.size() > 0 && result.size() == 0) {
    throw UsageError(fmt::format(
        "None of the {} Gaussians of {} is left: choose a larger box or a smaller opacity",
        model.size(), input.string()));
  }
  if (trace) trace->sky = transformed(trace->sky, map);
  write_model(output, result, encoding, trace, origin);
  std::string losses = io::losses(format, result);
  const bool leaves_out = result.size() < model.size() || result.sh_degree < model.sh_degree;
  if (leaves_out && losses == io::kNoLoss) losses = "nothing but what was asked for is left out";
  const std::string unsaid = format == io::ModelFormat::kPly ? "" : not_said(origin, trace);
  if (!unsaid.empty() && losses == io::kNoLoss) losses = "no number of the Gaussians is changed";
  return {model.size(), result.size(), result.sh_degree, losses + unsaid};
}

}  // namespace raysplats
