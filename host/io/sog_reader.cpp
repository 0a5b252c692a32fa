// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/byte_reader.hpp"
#include "io/gaussian_codes.hpp"
#include "io/json_file.hpp"
#include "io/model_formats.hpp"
#include "io/sog_file.hpp"
#include "io/webp_texture.hpp"
#include "io/zip_archive.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

using Json = nlohmann::json;

constexpr const char* kMeta = "meta.json";
/// Gaussians that a byte on the disk may stand for; real ones take 8 to 16 bytes.
constexpr std::uint64_t kMostPerByte = 8;
/// Bytes of meta.json; real ones have some ten thousand, and parsed text takes more than its bytes.
constexpr std::size_t kMostMeta = std::size_t{1} << 20;
/// Texels that a texture may have beyond those in use.
constexpr std::size_t kSlack = 4096;

/// The files of a SOG: of a zip archive, or beside a meta.json.
class Files {
 public:
  explicit Files(const std::filesystem::path& path) : path_(path) {
    if (path.filename() == kMeta) return;
    bytes_ = read_file(path);
    disk_bytes_ = bytes_.size();
    archive_.emplace(bytes_, path);
  }
  std::vector<std::byte> read(const std::string& name) {
    if (archive_) return archive_->read(name);
    std::vector<std::byte> bytes = read_file(path_.parent_path() / name);
    disk_bytes_ += bytes.size();
    return bytes;
  }
  const std::filesystem::path& path() const { return path_; }
  /// What lies on the disk: the archive, or the files that have been read.
  std::uint64_t disk_bytes() const { return disk_bytes_; }

 private:
  std::filesystem::path path_;
  std::vector<std::byte> bytes_;
  std::uint64_t disk_bytes_ = 0;
  std::optional<ZipArchive> archive_;
};

class Reader {
 public:
  explicit Reader(const std::filesystem::path& path) : files_(path) {
    const std::vector<std::byte> text = files_.read(kMeta);
    if (text.size() > kMostMeta)
      fail(fmt::format("its {} has {} bytes, more than {}", kMeta, text.size(), kMostMeta));
    meta_ = parse_json_object(text, path.filename() == kMeta ? path : path / kMeta);
  }

  Gaussians read() {
    if (is_first_version()) {
      throw DataError(fmt::format(
          "{} is a SOG of version 1, but only {} is known: write it again with SplatTransform or "
          "SuperSplat",
          files_.path().string(), kSogVersion));
    }
    if (whole(meta_, "version") != kSogVersion) {
      fail(fmt::format("its version is {}, but only {} is known", whole(meta_, "version"),
                       kSogVersion));
    }
    const std::int64_t count = whole(meta_, "count");
    if (count < 0) fail(fmt::format("its count is {}", count));
    count_ = static_cast<std::size_t>(count);
    Gaussians model;
    const Json* harmonics = meta_.contains("shN") ? &member(meta_, "shN") : nullptr;
    if (harmonics != nullptr) {
      const std::int64_t degree = whole(*harmonics, "bands");
      if (degree < 1 || degree > kSogMostDegree) fail(fmt::format("it has {} bands", degree));
      model.sh_degree = static_cast<int>(degree);
    }
    if (count_ == 0) return model;
    const Json& means = member(meta_, "means");
    const std::vector<std::byte> low = picture(means, 0), high = picture(means, 1);
    const std::vector<std::byte> scales = picture(member(meta_, "scales"), 0);
    const std::vector<std::byte> rotations = picture(member(meta_, "quats"), 0);
    const std::vector<std::byte> colors = picture(member(meta_, "sh0"), 0);
    std::vector<std::byte> centroids, labels;
    if (harmonics != nullptr) {
      centroids = picture(*harmonics, 0);
      labels = picture(*harmonics, 1);
    }
    // A few bytes can stand for any number of equal texels: neither the model nor a texture gets
    // memory before the count is borne out by the disk and by the header of every picture.
    if (count_ > saturating_product(files_.disk_bytes(), kMostPerByte)) {
      fail(fmt::format("it declares {} Gaussians, more than {} bytes can hold", count_,
                       files_.disk_bytes()));
    }
    for (const std::vector<std::byte>* part : {&low, &high, &scales, &rotations, &colors})
      texture_size(*part, texels(), picture_name());
    if (harmonics != nullptr) {
      texture_size(labels, texels(), picture_name());
      texture_size(centroids, palette_texels(*harmonics, palette_width(model.sh_degree)),
                   palette_name());
    }
    model.resize(count_);
    read_means(means, texture(low), texture(high), model);
    read_scales(texture(scales), model);
    read_rotations(texture(rotations), model);
    read_colors(texture(colors), model);
    if (harmonics != nullptr) read_harmonics(*harmonics, centroids, texture(labels), model);
    return model;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw DataError(fmt::format("{} is no valid SOG: {}", files_.path().string(), what));
  }

  /// It had no number of its version, but the shapes of its textures.
  bool is_first_version() const {
    const auto means = meta_.find("means");
    return !meta_.contains("version") && means != meta_.end() && means->is_object() &&
           means->contains("shape");
  }
  const Json& member(const Json& object, const char* name) const {
    const auto found = object.find(name);
    if (found == object.end()) fail(fmt::format("'{}' is missing in {}", name, kMeta));
    return *found;
  }
  std::int64_t whole(const Json& object, const char* name) const {
    const Json& value = object.is_object() ? member(object, name) : object;
    if (!value.is_number_integer()) fail(fmt::format("'{}' is no whole number", name));
    return value.get<std::int64_t>();
  }
  /// A list of exactly `count` finite numbers.
  std::vector<double> numbers(const Json& object, const char* name, std::size_t count) const {
    const Json& list = object.is_object() ? member(object, name) : object;
    if (!list.is_array() || list.size() != count)
      fail(fmt::format("'{}' is no list of {} numbers", name, count));
    std::vector<double> out;
    for (const Json& value : list) {
      const double number = value.is_number() ? value.get<double>() : std::nan("");
      if (!std::isfinite(static_cast<float>(number)))
        fail(fmt::format("'{}' holds something else than finite numbers", name));
      out.push_back(number);
    }
    return out;
  }
  std::vector<float> codebook(const Json& object) const {
    const std::vector<double> levels = numbers(object, "codebook", kSogLevels);
    return {levels.begin(), levels.end()};
  }

  /// Bytes of the picture `index` that an object of meta.json names.
  std::vector<std::byte> picture(const Json& object, std::size_t index) {
    if (!object.is_object()) fail("meta.json holds something else than objects");
    const Json& files = member(object, "files");
    if (!files.is_array() || files.size() <= index || !files[index].is_string())
      fail("'files' does not name its pictures");
    const std::string name = files[index].get<std::string>();
    // A file beside meta.json, and no other.
    if (name.empty() || name.front() == '.' || name.find_first_of("/\\") != std::string::npos ||
        name.find('\0') != std::string::npos)
      fail("'files' names something else than a file beside meta.json");
    if (!names_.insert(name).second) fail(fmt::format("'files' names {} twice", name));
    return files_.read(name);
  }
  std::string picture_name() const { return files_.path().string() + ": a picture"; }
  TexelRange texels() const { return {count_, count_ + count_ / 4 + kSlack}; }
  Texture texture(const std::vector<std::byte>& bytes) const {
    return decode_texture(bytes, texels(), picture_name());
  }
  std::string palette_name() const { return files_.path().string() + ": the palette"; }
  static std::size_t palette_width(int degree) {
    return kSogEntriesPerRow * static_cast<std::size_t>(sh_coefficients(degree) - 1);
  }
  std::size_t palette_entries(const Json& harmonics) const {
    const std::int64_t entries = whole(harmonics, "count");
    if (entries < 1 || entries > static_cast<std::int64_t>(kSogMostEntries))
      fail(fmt::format("it has {} palette entries", entries));
    return static_cast<std::size_t>(entries);
  }
  TexelRange palette_texels(const Json& harmonics, std::size_t width) const {
    const std::size_t rows =
        (palette_entries(harmonics) + kSogEntriesPerRow - 1) / kSogEntriesPerRow;
    return {width * rows, width * (rows + kSogEntriesPerRow)};
  }

  void read_means(const Json& means, const Texture& low, const Texture& high, Gaussians& model) {
    const std::vector<double> least = numbers(means, "mins", 3), most = numbers(means, "maxs", 3);
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        const int step = low.rgba[4 * i + k] | high.rgba[4 * i + k] << 8;
        const double n = least[k] + (most[k] - least[k]) * step / 65535.0;
        const auto x = static_cast<float>(std::copysign(std::expm1(std::abs(n)), n));
        if (!std::isfinite(x)) fail(fmt::format("the position of Gaussian {} is not finite", i));
        model.means[3 * i + k] = x;
      }
    }
  }
  void read_scales(const Texture& texture, Gaussians& model) {
    const std::vector<float> levels = codebook(member(meta_, "scales"));
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t k = 0; k < 3; ++k)
        model.log_scales[3 * i + k] = levels[texture.rgba[4 * i + k]];
    }
  }
  void read_rotations(const Texture& texture, Gaussians& model) {
    for (std::size_t i = 0; i < count_; ++i) {
      const int largest = texture.rgba[4 * i + 3] - kSogRotation;
      if (largest < 0) fail(fmt::format("the rotation of Gaussian {} has no largest part", i));
      double rest = 1.0;
      std::size_t from = 4 * i;
      float* q = &model.quaternions[4 * i];
      for (int k = 0; k < 4; ++k) {
        if (k == largest) continue;
        const double part = (texture.rgba[from++] / 255.0 - 0.5) * std::numbers::sqrt2;
        q[k] = static_cast<float>(part);
        rest -= part * part;
      }
      q[largest] = static_cast<float>(std::sqrt(std::max(rest, 0.0)));
    }
  }
  void read_colors(const Texture& texture, Gaussians& model) {
    const std::vector<float> levels = codebook(member(meta_, "sh0"));
    const auto stride = 3 * static_cast<std::size_t>(sh_coefficients(model.sh_degree));
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t k = 0; k < 3; ++k)
        model.sh[stride * i + k] = levels[texture.rgba[4 * i + k]];
      model.opacities[i] = logit_of(texture.rgba[4 * i + 3] / 255.0, kByteOpacityMargin);
    }
  }
  void read_harmonics(const Json& harmonics,
                      const std::vector<std::byte>& picture,
                      const Texture& labels,
                      Gaussians& model) {
    const std::size_t entries = palette_entries(harmonics);
    const std::vector<float> levels = codebook(harmonics);
    const auto higher = static_cast<std::size_t>(sh_coefficients(model.sh_degree) - 1);
    const std::size_t width = palette_width(model.sh_degree);
    const Texture centroids =
        decode_texture(picture, palette_texels(harmonics, width), palette_name());
    if (centroids.width != width) fail(fmt::format("its palette is {} wide", centroids.width));
    for (std::size_t i = 0; i < count_; ++i) {
      const auto label = static_cast<std::size_t>(labels.rgba[4 * i] | labels.rgba[4 * i + 1] << 8);
      if (label >= entries) fail(fmt::format("Gaussian {} has no entry of the palette", i));
      const std::uint8_t* texel = &centroids.rgba[4 * higher * label];
      float* sh = &model.sh[3 * (higher + 1) * i + 3];
      for (std::size_t k = 0; k < higher; ++k) {
        for (std::size_t c = 0; c < 3; ++c) sh[3 * k + c] = levels[texel[4 * k + c]];
      }
    }
  }

  Files files_;
  Json meta_;
  std::size_t count_ = 0;
  std::set<std::string> names_;  // of the pictures
};

}  // namespace

Gaussians read_sog(const std::filesystem::path& path) { return Reader(path).read(); }

}  // namespace raysplats::io
