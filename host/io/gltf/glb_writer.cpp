// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <glm/mat4x4.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "io/model/gaussian_codes.hpp"
#include "io/model/gltf_gaussians.hpp"
#include "io/model/model_formats.hpp"
#include "raysplats/error.hpp"
#include "scene/gaussians/gaussian_transform.hpp"
#include "util/atomic_file.hpp"

namespace raysplats::io {
namespace {

using Json = nlohmann::ordered_json;
static_assert(std::endian::native == std::endian::little, "floats are written as they are");

constexpr int kPoints = 0;
constexpr int kFloat = 5126;
constexpr int kArrayBuffer = 34962;
constexpr std::size_t kNumbersPerWrite = 1 << 16;
constexpr std::uint64_t kMostBytes = std::numeric_limits<std::uint32_t>::max();

/// Number k of Gaussian i.
using Value = std::function<float(std::size_t i, std::size_t k)>;

/// The arrays of the file one after the other, and the JSON that describes them.
class Glb {
 public:
  explicit Glb(std::size_t count) : count_(count) {
    json_["asset"] = {{"version", "2.0"},
                      {"generator", fmt::format("RaySplats-CL {}", RAYSPLATS_VERSION)}};
    json_["extensionsUsed"] = {kSplattingExtension};
    json_["scene"] = 0;
    json_["scenes"] = {{{"nodes", {0}}}};
    json_["nodes"] = {{{"mesh", 0}}};
  }

  /// `value` is called until the file is written; `bounds` as glTF wants them of positions.
  void add(const std::string& name, std::size_t width, Value value, bool bounds = false) {
    const std::array<const char*, 5> types{"", "SCALAR", "VEC2", "VEC3", "VEC4"};
    const std::size_t bytes = width * count_ * sizeof(float);
    json_["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", bytes_}, {"byteLength", bytes}, {"target", kArrayBuffer}});
    Json accessor{{"bufferView", arrays_.size()},
                  {"componentType", kFloat},
                  {"count", count_},
                  {"type", types[width]}};
    if (bounds) {
      std::vector<float> low(width, std::numeric_limits<float>::max());
      std::vector<float> high(width, std::numeric_limits<float>::lowest());
      for (std::size_t i = 0; i < width * count_; ++i) {
        const float number = value(i / width, i % width);
        low[i % width] = std::min(low[i % width], number);
        high[i % width] = std::max(high[i % width], number);
      }
      accessor["min"] = low;
      accessor["max"] = high;
    }
    attributes_[name] = arrays_.size();
    json_["accessors"].push_back(std::move(accessor));
    arrays_.push_back({width, std::move(value)});
    bytes_ += bytes;
  }

  void write(const std::filesystem::path& path) {
    json_["meshes"] = {
        {{"primitives",
          {{{"attributes", attributes_},
            {"mode", kPoints},
            {"extensions",
             {{kSplattingExtension,
               {{"kernel", "ellipse"}, {"colorSpace", "srgb_rec709_display"}}}}}}}}}};
    json_["buffers"] = {{{"byteLength", bytes_}}};
    std::string text = json_.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    constexpr std::uint64_t kFrame = 12 + 8 + 8;
    const std::uint64_t total = kFrame + text.size() + bytes_;
    if (total > kMostBytes) {
      throw DataError(fmt::format(
          "{} cannot be written: a GLB has at most 4 GiB, but {} Gaussians need {} bytes: write a "
          "PLY or an SPZ, or fewer SH degrees",
          path.string(), count_, total));
    }
    AtomicFile file(path);
    const auto word = [&](std::uint64_t value) {
      const auto bits = static_cast<std::uint32_t>(value);
      file.write(&bits, sizeof(bits));
    };
    file.write("glTF");
    word(2);
    word(total);
    word(text.size());
    file.write("JSON");
    file.write(text);
    word(bytes_);
    file.write(std::string_view("BIN\0", 4));
    for (const Array& array : arrays_) write(file, array);
    file.commit();
  }

 private:
  struct Array {
    std::size_t width;
    Value value;
  };
  /// By parts, as all arrays together are as large as the model.
  void write(AtomicFile& file, const Array& array) const {
    std::vector<float> numbers;
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t k = 0; k < array.width; ++k) numbers.push_back(array.value(i, k));
      if (numbers.size() < kNumbersPerWrite && i + 1 < count_) continue;
      file.write(numbers.data(), numbers.size() * sizeof(float));
      numbers.clear();
    }
  }

  std::size_t count_;
  std::uint64_t bytes_ = 0;
  Json json_;
  Json attributes_;
  std::vector<Array> arrays_;
};

}  // namespace

void write_glb(const std::filesystem::path& path, const Gaussians& model) {
  if (model.size() == 0) {
    throw DataError(fmt::format(
        "{} cannot be written: glTF has no empty arrays, and the model has no Gaussians",
        path.string()));
  }
  const glm::dmat4 turn = splatting_turn();
  const Gaussians turned = model.sh_degree > kSplattingMaxDegree
                               ? transformed(with_sh_degree(model, kSplattingMaxDegree), turn)
                               : transformed(model, turn);
  Glb glb(turned.size());
  glb.add(
      "POSITION", 3, [&](std::size_t i, std::size_t k) { return turned.means[3 * i + k]; }, true);
  glb.add(kSplattingRotation, 4, [&](std::size_t i, std::size_t k) {
    return static_cast<float>(unit_quaternion(&turned.quaternions[4 * i])[(k + 1) % 4]);
  });
  glb.add(kSplattingScale, 3, [&](std::size_t i, std::size_t k) {
    return std::exp(std::min(turned.log_scales[3 * i + k], kMostLogScale));
  });
  glb.add(kSplattingOpacity, 1, [&](std::size_t i, std::size_t) {
    return static_cast<float>(opacity_of(turned.opacities[i]));
  });
  const std::size_t stride = 3 * static_cast<std::size_t>(sh_coefficients(turned.sh_degree));
  std::size_t coefficient = 0;
  for (int degree = 0; degree <= turned.sh_degree; ++degree) {
    for (int n = 0; n <= 2 * degree; ++n, ++coefficient) {
      glb.add(splatting_harmonic(degree, n), 3, [&, coefficient](std::size_t i, std::size_t k) {
        return turned.sh[stride * i + 3 * coefficient + k];
      });
    }
  }
  glb.write(path);
}

}  // namespace raysplats::io
