// SPDX-License-Identifier: Apache-2.0
#include "io/convert_model.hpp"

#include <fmt/format.h>

#include "io/model_file.hpp"
#include "raysplats/error.hpp"
#include "scene/gaussian_transform.hpp"
#include "scene/model_changes.hpp"

namespace raysplats {
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
