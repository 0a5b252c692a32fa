// SPDX-License-Identifier: Apache-2.0
#include "io/model/convert_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <utility>

#include "io/dataset/data_origin.hpp"
#include "io/model/float_blur.hpp"
#include "io/model/gltf_gaussians.hpp"
#include "io/model/model_file.hpp"
#include "io/model/ply_options.hpp"
#include "io/model/spz_axes.hpp"
#include "raysplats/error.hpp"
#include "scene/gaussians/gaussian_transform.hpp"
#include "scene/gaussians/model_changes.hpp"
#include "util/atomic_file.hpp"
#include "util/stop_if_interrupted.hpp"

namespace raysplats {
namespace {

// Where positions count from, in the axes of the file.
std::string counted_from(const glm::dvec3& origin,
                         io::ModelFormat format,
                         const ModelEncoding& encoding) {
  glm::dvec3 place = origin;
  if (format == io::ModelFormat::kGltf) place = glm::dmat3(io::splatting_turn()) * origin;
  if (format == io::ModelFormat::kSpz && encoding.spz_axes == SpzAxes::kRub)
    place = glm::dmat3(io::spz_axes_turn(io::kSpzRub)) * origin;
  place += 0.0;  // never -0
  return fmt::format(", positions count from {}, {}, {}", place.x, place.y, place.z);
}

// What a file without the comments of our PLY does not say of a model.
std::string not_said(const std::optional<TraceOptions>& trace) {
  std::string out;
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

// How far single precision shifts positions, where that is seen.
struct Blur {
  double shift;
  bool much;  // of the median size
};

// Of positions that are turned, scaled and then moved by `offset`. Nothing where it is no more than
// a hundredth of the median size, or than twice of what it was before, and for what is beyond all
// floats, which is refused where it is moved.
std::optional<Blur> blur_of_moved(const Gaussians& model,
                                  const glm::dmat3& linear,
                                  double scale,
                                  const glm::dvec3& offset) {
  constexpr double kMuch = 0.1;
  io::GaussianPlaces places;
  places.reserve(model.size());
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float* m = &model.means[3 * i];
    const float* s = &model.log_scales[3 * i];
    places.add(linear * glm::dvec3(m[0], m[1], m[2]), std::max({s[0], s[1], s[2]}));
  }
  const glm::dvec3 center = places.median_position();
  const double size = scale * places.median_size();
  const double most = std::max(io::unseen_blur(size), 2.0 * io::blur_at(center));
  const double shift = io::blur_at(center + offset);
  if (!(shift > most) || glm::length(center + offset) > FLT_MAX) return std::nullopt;
  return Blur{shift, shift > kMuch * size};
}

void check_near(const glm::dvec3& origin) {
  const glm::dvec3 size = glm::abs(origin);
  if (std::max({size.x, size.y, size.z}) <= io::kFarthestOrigin) return;
  throw UsageError(
      fmt::format("The model's positions would count from {:g}, {:g}, {:g}: no number of that may "
                  "be beyond {:g}, translate it less",
                  origin.x, origin.y, origin.z, io::kFarthestOrigin));
}

/// Where the numbers of a changed model go, and what they count from.
struct Placement {
  ModelChanges changes;    ///< of the numbers
  glm::dvec3 origin{0.0};  ///< of positions, which are their numbers and this
  std::string blurred;     ///< what floats lose of them; "" for nothing
};

/// Positions are their numbers in the file plus its origin, which scales and turns as they do.
Placement placed(const Gaussians& model,
                 const glm::dvec3& origin,
                 io::ModelFormat format,
                 const ModelChanges& changes,
                 const glm::dmat3& linear) {
  Placement out{changes, linear * origin, {}};
  if (changes.translate != glm::dvec3(0.0)) {
    const bool had_origin = out.origin != glm::dvec3(0.0);
    const bool says_origin = format == io::ModelFormat::kPly;
    out.origin += changes.translate;
    out.changes.translate = glm::dvec3(0.0);
    const auto blur = blur_of_moved(model, linear, changes.scale, out.origin);
    // A file that cannot say an origin does not get one: the model would stay where it was, as it
    // does for other programs and beside models without one. So none is given for little either.
    const bool keeps_origin = blur && (had_origin || (says_origin && blur->much));
    if (!keeps_origin) std::swap(out.changes.translate, out.origin);
    if (blur && !keeps_origin) {
      out.blurred =
          fmt::format("32-bit numbers shift positions by {:.2g} that far away{}", blur->shift,
                      blur->much ? ", but not in a .ply, which says an origin" : "");
    }
    check_near(out.origin);
  }
  if (std::optional<Bounds>& crop = out.changes.crop) {
    for (int k = 0; k < 3; ++k) {
      crop->low[static_cast<std::size_t>(k)] -= out.origin[k];
      crop->high[static_cast<std::size_t>(k)] -= out.origin[k];
    }
  }
  return out;
}

/// Moves what the options of a file say of the world.
void move_trace(TraceOptions& trace,
                const glm::dmat4& map,
                double scale,
                const std::filesystem::path& input) {
  trace.sky = transformed(trace.sky, map);
  const float near_depth = trace.near_depth * static_cast<float>(scale);
  if (!std::isfinite(near_depth)) {
    throw UsageError(
        fmt::format("The near depth of {}, {}, would be beyond what 32-bit numbers hold: use a "
                    "smaller scale than {}",
                    input.string(), trace.near_depth, scale));
  }
  trace.near_depth = near_depth;
}

/// What a format loses of the model and of what was said with it. `leaves_out`: Gaussians, or
/// harmonics, as was asked for.
std::string losses_of(io::ModelFormat format,
                      const Gaussians& model,
                      const Placement& placement,
                      bool leaves_out,
                      const ModelEncoding& encoding,
                      const std::optional<TraceOptions>& trace) {
  std::string losses = io::losses(format, model);
  if (!placement.blurred.empty())
    losses = losses == io::kNoLoss ? placement.blurred : losses + ", " + placement.blurred;
  if (leaves_out && losses == io::kNoLoss) losses = "nothing but what was asked for is left out";
  std::string place;
  if (placement.origin != glm::dvec3(0.0)) place = counted_from(placement.origin, format, encoding);
  if (format == io::ModelFormat::kPly) {
    if (!place.empty()) place += ", as its header says, which other programs pass over";
    return losses + place;
  }
  if (!place.empty()) place += ", which is not said in the file";
  const std::string unsaid = place + not_said(trace);
  if (!unsaid.empty() && losses == io::kNoLoss) losses = "no number of the Gaussians is changed";
  return losses + unsaid;
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
  const Placement placement = placed(model, origin_of(input), format, changes, glm::dmat3(map));
  const Gaussians result = changed(std::move(model), placement.changes);
  if (read > 0 && result.size() == 0) {
    throw UsageError(fmt::format(
        "None of the {} Gaussians of {} is left: choose a larger box or a smaller opacity", read,
        input.string()));
  }
  if (trace) move_trace(*trace, map, changes.scale, input);
  stop_if_interrupted();
  const glm::dvec3& origin = placement.origin;
  write_model(output, result, encoding, trace, {origin.x, origin.y, origin.z});
  const bool leaves_out = result.size() < read || result.sh_degree < degree;
  return {read, result.size(), result.sh_degree,
          losses_of(format, result, placement, leaves_out, encoding, trace)};
}

}  // namespace raysplats
