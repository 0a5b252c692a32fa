// SPDX-License-Identifier: Apache-2.0
#include "io/model/model_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include "io/model/gaussian_codes.hpp"
#include "io/model/gltf_gaussians.hpp"
#include "io/model/model_formats.hpp"
#include "io/model/sog_file.hpp"
#include "io/model/spz_codes.hpp"
#include "raysplats/error.hpp"
#include "scene/gaussians/gaussian_check.hpp"
#include "util/path_text.hpp"

namespace raysplats {
namespace io {
namespace {

constexpr const char* kSogMeta = "meta.json";  // of one that is unpacked

/// The first bytes of a file, fewer where it is shorter or cannot be read.
std::string first_bytes(const std::filesystem::path& path) {
  std::array<char, 4> bytes{};
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return "";
  std::ifstream stream(path, std::ios::binary);
  stream.read(bytes.data(), bytes.size());
  return std::string(bytes.data(), static_cast<std::size_t>(stream.gcount()));
}

/// What of a model is cut to a range, as a part of a sentence: of the Gaussians' numbers, `stride`
/// of each, `count` from the number `first` on. "" where all lie within it.
std::string clamped(const char* what,
                    const std::vector<float>& numbers,
                    std::size_t stride,
                    std::size_t first,
                    std::size_t count,
                    double least,
                    double most) {
  std::size_t beyond = 0;
  for (std::size_t i = 0; i < numbers.size(); i += stride) {
    const std::span<const float> values(numbers.data() + i + first, count);
    beyond +=
        std::any_of(values.begin(), values.end(), [&](float v) { return v < least || v > most; });
  }
  return beyond == 0 ? ""
                     : fmt::format(", {} ({} of {} Gaussians) are clamped", what, beyond,
                                   numbers.size() / stride);
}

/// What of a model lies beyond what SPZ has codes for.
std::string spz_clamped(const Gaussians& model) {
  const std::size_t stride = 3 * static_cast<std::size_t>(sh_coefficients(model.sh_degree));
  constexpr double most_color = 0.5 / kSpzColorScale;
  return clamped("scales beyond 4.5e-5 to 380", model.log_scales, 3, 0, 3, kSpzLeastLogScale,
                 kSpzMostLogScale) +
         clamped("colours beyond +-3.33 in SH", model.sh, stride, 0, 3, -most_color, most_color) +
         clamped("SH beyond +-1", model.sh, stride, 3, stride - 3, -1.0, 1.0);
}

/// A GLB holds sizes and opacities, of which reading takes logarithms and logits.
std::string gltf_losses(const Gaussians& model) {
  std::string out;
  if (model.sh_degree > kSplattingMaxDegree)
    out += fmt::format(", SH above degree {} is left out", kSplattingMaxDegree);
  out += clamped("scales beyond 1e-30 to 2.4e17", model.log_scales, 3, 0, 3,
                 std::log(kSplattingLeastScale), kMostLogScale);
  out += clamped("opacities within 1e-7 of 0 or 1", model.opacities, 1, 0, 1, logit_of(0.0),
                 logit_of(1.0));
  return out.empty() ? kNoLoss : out.substr(2);
}

std::string spz_losses(const Gaussians& model) {
  return fmt::format(
      "positions are kept to 1/{}, scales to 3 %, rotations to 1/670, opacities and colours to 8 "
      "bits{}{}",
      1 << spz_fractional_bits(model), model.sh_degree > 0 ? ", SH to 6 bits" : "",
      spz_clamped(model));
}

}  // namespace

std::filesystem::path file_of(const std::filesystem::path& path) {
  const std::filesystem::path meta = path / kSogMeta;
  std::error_code error;
  return std::filesystem::is_regular_file(meta, error) ? meta : path;
}

ModelFormat model_format(const std::filesystem::path& path) {
  const std::string start = first_bytes(path);
  const std::string extension = lower_extension(path);
  if (start.starts_with("ply")) return ModelFormat::kPly;
  // A .splat begins with a number, whose bytes may be the two of gzip.
  const bool is_gzip = start.starts_with("\x1f\x8b") && extension != ".splat";
  if (is_gzip || start == "NGSP") return ModelFormat::kSpz;
  if (start == "glTF") return ModelFormat::kGltf;
  if (start == "PK\x03\x04") return ModelFormat::kSog;
  if (extension == ".splat") return ModelFormat::kSplat;
  if (extension == ".spz") return ModelFormat::kSpz;
  if (extension == ".glb" || extension == ".gltf") return ModelFormat::kGltf;
  if (extension == ".sog" || path.filename() == kSogMeta) return ModelFormat::kSog;
  // Files that are missing, too, are best explained by the reader.
  const bool readable = !start.empty() && extension != ".ply";
  return readable ? ModelFormat::kUnknown : ModelFormat::kPly;
}

std::array<double, 3> model_origin(const std::filesystem::path& path) {
  return model_format(path) == ModelFormat::kPly ? read_ply_origin(path) : std::array<double, 3>{};
}

ModelFormat output_format(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  if (extension == ".ply") {
    return lower_extension(path.stem()) == ".compressed" ? ModelFormat::kCompressedPly
                                                         : ModelFormat::kPly;
  }
  if (extension == ".splat") return ModelFormat::kSplat;
  if (extension == ".spz") return ModelFormat::kSpz;
  if (extension == ".sog") return ModelFormat::kSog;
  if (extension == ".glb") return ModelFormat::kGltf;
  throw UsageError(
      fmt::format("{} does not say what to write: give a name that ends in .ply, .compressed.ply, "
                  ".splat, .spz, "
                  ".sog or .glb",
                  path.string()));
}

std::string losses(ModelFormat format, const Gaussians& model) {
  switch (format) {
    case ModelFormat::kPly:
      return kNoLoss;
    case ModelFormat::kCompressedPly:
      return fmt::format(
          "positions, scales, colours and opacities are kept to 1/1000 of their range among 256 "
          "neighbours (8 bits for colours), rotations to 1/670{}{}",
          model.sh_degree > 0 ? ", SH to 8 bits between -4 and 4" : "",
          model.sh_degree > 3 ? ", SH above degree 3 is left out" : "");
    case ModelFormat::kSplat:
      return fmt::format(
          "{}colours are cut to 0..1, colours, opacities and rotations have 8 bits",
          model.sh_degree > 0 ? "colours no longer change with the view (no SH), " : "");
    case ModelFormat::kSpz:
      return spz_losses(model);
    case ModelFormat::kSog:
      return fmt::format(
          "positions are kept to 1/65536 of the range of their logarithm, rotations to 1/170, "
          "scales, colours and "
          "opacities to 8 bits{}{}",
          model.sh_degree > 0 ? ", SH to an entry of a palette that all share" : "",
          model.sh_degree > kSogMostDegree
              ? fmt::format(", SH above degree {} is left out", kSogMostDegree)
              : "");
    case ModelFormat::kGltf:
      return gltf_losses(model);
    case ModelFormat::kUnknown:
      break;
  }
  return "";
}

}  // namespace io

Gaussians read_model(const std::filesystem::path& path, const ModelEncoding& encoding) {
  const std::filesystem::path file = io::file_of(path);
  switch (io::model_format(file)) {
    case io::ModelFormat::kSplat:
      return io::read_splat(file, encoding.drop_nonfinite);
    case io::ModelFormat::kGltf:
      return io::read_gltf_gaussians(file, encoding.drop_nonfinite);
    case io::ModelFormat::kSog:
      return io::read_sog(file);
    case io::ModelFormat::kSpz:
      return io::read_spz(file, encoding.spz_axes);
    case io::ModelFormat::kPly:
    case io::ModelFormat::kCompressedPly:
      return read_ply(file, encoding.drop_nonfinite);
    case io::ModelFormat::kUnknown:
      break;
  }
  throw DataError(fmt::format(
      "{} is no model that is known: those are PLY, .splat, SPZ, SOG and glTF with Gaussians",
      path.string()));
}

void write_model(const std::filesystem::path& path,
                 const Gaussians& model,
                 const ModelEncoding& encoding,
                 const std::optional<TraceOptions>& trace,
                 const std::array<double, 3>& origin) {
  const io::ModelFormat format = io::output_format(path);
  check_gaussians(model);
  switch (format) {
    case io::ModelFormat::kPly:
      return io::write_ply_as_it_is(path, model, trace, origin);
    case io::ModelFormat::kCompressedPly:
      return io::write_compressed_ply(path, model);
    case io::ModelFormat::kSplat:
      return io::write_splat(path, model);
    case io::ModelFormat::kGltf:
      return io::write_glb(path, model);
    case io::ModelFormat::kSog:
      return io::write_sog(path, model);
    case io::ModelFormat::kUnknown:
      break;
    case io::ModelFormat::kSpz:
      if (encoding.spz_version != 3 && encoding.spz_version != 4) {
        throw UsageError(
            fmt::format("SPZ is written in version 3 or 4, not {}", encoding.spz_version));
      }
      io::write_spz(path, model, encoding.spz_version, encoding.spz_axes);
  }
}

}  // namespace raysplats
