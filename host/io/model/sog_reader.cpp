// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/byte_reader.hpp"
#include "io/image/webp_texture.hpp"
#include "io/json_file.hpp"
#include "io/model/gaussian_codes.hpp"
#include "io/model/model_formats.hpp"
#include "io/model/sog_file.hpp"
#include "io/zip_archive.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

using Json = nlohmann::json;

constexpr const char* kMeta = "meta.json";
/// Bytes of meta.json; real ones have some ten thousand, and parsed text takes more than its bytes.
constexpr std::size_t kMostMeta = std::size_t{1} << 20;
/// Texels that a texture may have beyond those in use.
constexpr std::size_t kSlack = 4096;
/// Texels of a palette of which nothing but the picture tells the size: from a row of degree 1 to
/// all entries of degree 3.
constexpr TexelRange kAnyPalette{3 * kSogEntriesPerRow, 15 * kSogMostEntries};

/// torch.save() writes zip archives too.
void refuse_checkpoint(const std::vector<std::string>& names, const std::filesystem::path& path) {
  const bool is_checkpoint = std::any_of(names.begin(), names.end(), [](const std::string& name) {
    return std::filesystem::path(name).filename() == "data.pkl";
  });
  if (!is_checkpoint) return;
  throw DataError(
      fmt::format("{} is a checkpoint of PyTorch: export the model in it as a PLY with the program "
                  "that wrote it, and give that",
                  path.string()));
}

/// The one folder of an archive that has a meta.json, where none lies outside of folders: systems
/// that pack a folder put its name in front. "" where there is no such or several; macOS's own
/// folder does not count.
std::string folder_of_meta(const std::vector<std::string>& names) {
  std::vector<std::string> folders;
  for (const std::string& name : names) {
    if (name == kMeta) return "";
    const std::size_t slash = name.find('/');
    if (slash == std::string::npos || name.substr(slash + 1) != kMeta) continue;
    if (!name.starts_with("__MACOSX/")) folders.push_back(name.substr(0, slash + 1));
  }
  return folders.size() == 1 ? folders.front() : "";
}

/// The files of a SOG: of a zip archive, or beside a meta.json.
class Files {
 public:
  explicit Files(const std::filesystem::path& path) : path_(path) {
    if (path.filename() == kMeta) return;
    bytes_ = read_file(path);
    disk_bytes_ = bytes_.size();
    archive_.emplace(bytes_, path);
    const std::vector<std::string> names = archive_->names();
    refuse_checkpoint(names, path);
    folder_ = folder_of_meta(names);
  }
  std::vector<std::byte> read(const std::string& name) {
    if (archive_) return archive_->read(folder_ + name);
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
  std::string folder_;  // in the archive, with its slash
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
    first_ = is_first_version();
    if (!first_ && whole(meta_, "version") != kSogVersion) {
      fail(fmt::format("its version is {}, but only {} is known", whole(meta_, "version"),
                       kSogVersion));
    }
    const std::int64_t count = first_ ? count_by_shape() : whole(meta_, "count");
    if (count < 0) fail(fmt::format("its count is {}", count));
    count_ = static_cast<std::size_t>(count);
    Gaussians model;
    const Json* harmonics = meta_.contains("shN") ? &member(meta_, "shN") : nullptr;
    if (harmonics != nullptr && !first_) model.sh_degree = degree_by_bands(*harmonics);
    if (count_ == 0) return model;
    if (first_) require_packed_rotations();
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
    if (count_ > kAlwaysHeld && count_ > saturating_product(files_.disk_bytes(), kSogMostPerByte)) {
      fail(fmt::format("it declares {} Gaussians, more than {} bytes can hold", count_,
                       files_.disk_bytes()));
    }
    for (const std::vector<std::byte>* part : {&low, &high, &scales, &rotations, &colors})
      texture_size(*part, texels(), picture_name());
    std::size_t entries = 0;
    if (harmonics != nullptr) {
      texture_size(labels, texels(), picture_name());
      if (first_) {
        const Texture size = texture_size(centroids, kAnyPalette, palette_name());
        model.sh_degree = degree_by_width(size.width);
        entries = kSogEntriesPerRow * size.height;
      } else {
        entries = palette_entries(*harmonics);
        texture_size(centroids, palette_texels(entries, model.sh_degree), palette_name());
      }
    }
    model.resize(count_);
    read_means(means, texture(low), texture(high), model);
    read_scales(texture(scales), model);
    read_rotations(texture(rotations), model);
    read_colors(texture(colors), model);
    if (harmonics != nullptr)
      read_harmonics(*harmonics, centroids, entries, texture(labels), model);
    return model;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw DataError(fmt::format("{} is no valid SOG: {}", files_.path().string(), what));
  }

  /// It had no number of its version, but the shapes of its arrays.
  bool is_first_version() const {
    const auto means = meta_.find("means");
    return !meta_.contains("version") && means != meta_.end() && means->is_object() &&
           means->contains("shape");
  }
  std::int64_t count_by_shape() const {
    const Json& shape = member(member(meta_, "means"), "shape");
    if (!shape.is_array() || shape.empty()) fail("'shape' is no list of whole numbers");
    return whole(shape.front(), "shape");
  }
  /// The compression of gsplat, from which that version came, has arrays of the same names, but
  /// three numbers of a rotation and a picture of opacities.
  void require_packed_rotations() const {
    const Json& rotations = member(meta_, "quats");
    const auto encoding = rotations.find("encoding");
    if (encoding == rotations.end() || *encoding != "quaternion_packed")
      fail("it has no number of its version, and 'encoding' of 'quats' is not quaternion_packed");
  }
  int degree_by_bands(const Json& harmonics) const {
    const std::int64_t degree = whole(harmonics, "bands");
    if (degree < 1 || degree > kSogMostDegree) fail(fmt::format("it has {} bands", degree));
    return static_cast<int>(degree);
  }
  /// The first version says nowhere else how many bands there are.
  int degree_by_width(std::size_t width) const {
    for (int degree = 1; degree <= kSogMostDegree; ++degree) {
      if (palette_width(degree) == width) return degree;
    }
    fail(fmt::format("its palette is {} wide", width));
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
  double number(const Json& object, const char* name) const {
    return numbers(Json::array({member(object, name)}), name, 1).front();
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
  /// What the bytes of a texture's channels stand for: a codebook that all of them share, or of the
  /// first version steps between two numbers of each channel's own.
  std::vector<std::vector<float>> channel_levels(const Json& object, std::size_t channels) const {
    std::vector<std::vector<float>> out;
    if (!first_) {
      out.assign(channels, codebook(object));
      return out;
    }
    const std::vector<double> least = numbers(object, "mins", channels);
    const std::vector<double> most = numbers(object, "maxs", channels);
    for (std::size_t k = 0; k < channels; ++k) out.push_back(steps(least[k], most[k]));
    return out;
  }
  static std::vector<float> steps(double least, double most) {
    std::vector<float> out(kSogLevels);
    for (std::size_t i = 0; i < kSogLevels; ++i) {
      const double share = static_cast<double>(i) / (kSogLevels - 1);
      out[i] = static_cast<float>(least + (most - least) * share);
    }
    return out;
  }
  std::vector<float> codebook(const Json& object) const {
    Json given = object;
    // Early writers left out the least level, and PlayCanvas's reader goes one mean step below the
    // next.
    const auto list = given.is_object() ? given.find("codebook") : given.end();
    const bool headless = list != given.end() && list->is_array() && list->size() == kSogLevels &&
                          list->front().is_null();
    if (headless) list->front() = list->at(1);
    const std::vector<double> levels = numbers(given, "codebook", kSogLevels);
    std::vector<float> out(levels.begin(), levels.end());
    if (headless)
      out[0] = static_cast<float>(levels[1] - (levels.back() - levels[1]) / (kSogLevels - 1));
    return out;
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
  static TexelRange palette_texels(std::size_t entries, int degree) {
    const std::size_t rows = (entries + kSogEntriesPerRow - 1) / kSogEntriesPerRow;
    const std::size_t width = palette_width(degree);
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
    const auto levels = channel_levels(member(meta_, "scales"), 3);
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t k = 0; k < 3; ++k)
        model.log_scales[3 * i + k] = levels[k][texture.rgba[4 * i + k]];
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
    // In the first version alpha is a fourth channel of logits.
    const auto levels = channel_levels(member(meta_, "sh0"), first_ ? 4 : 3);
    const auto stride = 3 * static_cast<std::size_t>(sh_coefficients(model.sh_degree));
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t k = 0; k < 3; ++k)
        model.sh[stride * i + k] = levels[k][texture.rgba[4 * i + k]];
      const std::uint8_t alpha = texture.rgba[4 * i + 3];
      model.opacities[i] = first_ ? levels[3][alpha] : logit_of(alpha / 255.0);
    }
  }
  void read_harmonics(const Json& harmonics,
                      const std::vector<std::byte>& picture,
                      std::size_t entries,
                      const Texture& labels,
                      Gaussians& model) {
    const std::vector<float> levels =
        first_ ? steps(number(harmonics, "mins"), number(harmonics, "maxs")) : codebook(harmonics);
    const auto higher = static_cast<std::size_t>(sh_coefficients(model.sh_degree) - 1);
    const Texture centroids =
        decode_texture(picture, palette_texels(entries, model.sh_degree), palette_name());
    if (centroids.width != palette_width(model.sh_degree))
      fail(fmt::format("its palette is {} wide", centroids.width));
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
  bool first_ = false;  // of the versions
  std::size_t count_ = 0;
  std::set<std::string> names_;  // of the pictures
};

}  // namespace

Gaussians read_sog(const std::filesystem::path& path) { return Reader(path).read(); }

}  // namespace raysplats::io
