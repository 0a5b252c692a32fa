// SPDX-License-Identifier: Apache-2.0
// EXR by OpenEXR: its core in C looks at the header first, because the classes in C++ believe the
// sizes that a damaged one states; they read and write the pixels, in every compression.
#include "images/exr_codec.hpp"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfChromaticities.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/openexr.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <exception>
#include <initializer_list>
#include <utility>

#include "images/library_reason.hpp"
#include "io/image/image_limits.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

constexpr int kPart = 0;

// OpenImageIO's, which its own files never have: the curve has no attribute of OpenEXR's.
constexpr const char* kColorSpace = "oiio:ColorSpace";
constexpr const char* kDisplay = "sRGB";
// Ours. By the format's convention alpha multiplies colours; pictures are stored with theirs as
// they are, which in those that are drawn have the background in them.
constexpr const char* kAlpha = "raysplats:alpha";
constexpr const char* kStraight = "straight";

constexpr std::size_t kNamed = 8;  // channels that a refusal names

// What the core has told last; it has no other place for it while a file is being opened.
thread_local std::string core_message;

void keep_message(exr_const_context_t, exr_result_t, const char* message) {
  core_message = message;
}

// An opened file of the core.
class CoreFile {
 public:
  explicit CoreFile(const std::string& path) : path_(path) {
    exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
    options.error_handler_fn = keep_message;
    options.max_image_width = options.max_image_height = kMaxImageSide;
    options.max_tile_width = options.max_tile_height = kMaxImageSide;
    check(exr_start_read(&context_, path.c_str(), &options));
  }
  ~CoreFile() { exr_finish(&context_); }
  CoreFile(const CoreFile&) = delete;
  CoreFile& operator=(const CoreFile&) = delete;

  void check(exr_result_t result) const {
    if (result != EXR_ERR_SUCCESS) fail_to_read(path_, core_message);
  }
  exr_context_t get() const { return context_; }

 private:
  const std::string& path_;
  exr_context_t context_ = nullptr;
};

// Throws DataError for a header that is damaged, or of no flat picture of a bearable size.
void check_header(const std::string& path) {
  core_message.clear();
  const CoreFile file(path);
  exr_storage_t storage{};
  file.check(exr_get_storage(file.get(), kPart, &storage));
  if (storage != EXR_STORAGE_SCANLINE && storage != EXR_STORAGE_TILED)
    throw DataError(fmt::format("The image {} is not a flat picture with pixels", path));
  exr_attr_box2i_t data{}, display{};
  file.check(exr_get_data_window(file.get(), kPart, &data));
  file.check(exr_get_display_window(file.get(), kPart, &display));
  for (const exr_attr_box2i_t& window : {data, display}) {
    require_bearable_size(path, std::int64_t{window.max.x} - window.min.x + 1,
                          std::int64_t{window.max.y} - window.min.y + 1);
  }
  // The table of chunks is read, so that its length is known to be in the file.
  std::int32_t chunks = 0;
  file.check(exr_get_chunk_count(file.get(), kPart, &chunks));
  const std::uintmax_t bytes = std::filesystem::file_size(path);
  if (chunks < 1 || static_cast<std::uintmax_t>(chunks) > bytes / sizeof(std::uint64_t))
    fail_to_read(path, fmt::format("it cannot hold {} chunks", chunks));
}

// "ViewLayer.Combined." where the file has R, G and B of such layers; empty where it has none. The
// first one by name, but what a renderer calls Combined comes before the parts of it.
std::string chosen_layer(const Imf::ChannelList& channels) {
  std::string first;
  for (auto channel = channels.begin(); channel != channels.end(); ++channel) {
    const std::string name = channel.name();
    if (!name.ends_with(".R")) continue;
    std::string layer = name.substr(0, name.size() - 1);
    if (channels.findChannel(layer + "G") == nullptr ||
        channels.findChannel(layer + "B") == nullptr) {
      continue;
    }
    if (layer == "Combined." || layer.ends_with(".Combined.")) return layer;
    if (first.empty()) first = layer;
  }
  return first;
}

std::vector<std::string> chosen_channels(const std::string& path,
                                         const Imf::ChannelList& channels) {
  std::vector<std::string> all, names;
  for (auto channel = channels.begin(); channel != channels.end(); ++channel)
    all.emplace_back(channel.name());
  if (all.empty()) fail_to_read(path, "it has no channels");
  if (all.size() == 1) return all;
  const auto take = [&](const std::string& layer, std::initializer_list<const char*> wanted) {
    for (const char* name : wanted) {
      if (channels.findChannel(layer + name) != nullptr) names.push_back(layer + name);
    }
  };
  const auto count = [&](std::initializer_list<const char*> wanted) {
    return std::count_if(wanted.begin(), wanted.end(),
                         [&](const char* name) { return channels.findChannel(name) != nullptr; });
  };
  const auto primaries = count({"R", "G", "B"});
  if (primaries == 1 || primaries == 3) {
    take("", {"R", "G", "B", "A"});
  } else if (primaries == 0 && count({"Y"}) == 1 && count({"RY", "BY"}) == 0) {
    take("", {"Y", "A"});
  } else if (const std::string layer = chosen_layer(channels); !layer.empty()) {
    take(layer, {"R", "G", "B", "A"});
  }
  if (!names.empty()) return names;
  const std::size_t more = all.size() - std::min(all.size(), kNamed);
  all.resize(all.size() - more);
  throw DataError(fmt::format(
      "The image {} has the channels {}{} and no colours that are read among them: it must have R, "
      "G and B, of a layer or without, or Y without RY and BY, or one channel alone",
      path, fmt::join(all, ", "), more > 0 ? fmt::format(" and {} more", more) : ""));
}

int width_of(const Imath::Box2i& window) { return window.max.x - window.min.x + 1; }
int height_of(const Imath::Box2i& window) { return window.max.y - window.min.y + 1; }

// "red 0.713 0.293, ..." where a file has other primaries or another white than Rec. 709; "" where
// it says those, or nothing, which means the same.
std::string foreign_chromaticities(const Imf::Header& header) {
  if (!Imf::hasChromaticities(header)) return {};
  constexpr float kNear = 2e-3f;  // D65 is rounded in several ways
  const Imf::Chromaticities own, &c = Imf::chromaticities(header);
  if (c.red.equalWithAbsError(own.red, kNear) && c.green.equalWithAbsError(own.green, kNear) &&
      c.blue.equalWithAbsError(own.blue, kNear) && c.white.equalWithAbsError(own.white, kNear)) {
    return {};
  }
  return fmt::format(
      "red {:.4g} {:.4g}, green {:.4g} {:.4g}, blue {:.4g} {:.4g}, white {:.4g} {:.4g}", c.red.x,
      c.red.y, c.green.x, c.green.y, c.blue.x, c.blue.y, c.white.x, c.white.y);
}

class ExrDecoder : public ImageDecoder {
 public:
  explicit ExrDecoder(const std::string& path)
      : path_(path),
        file_(path.c_str()),
        data_(file_.header().dataWindow()),
        display_(file_.header().displayWindow()) {}

  int width() const override { return width_of(display_); }
  int height() const override { return height_of(display_); }
  int sample_bytes() const override { return sizeof(float); }
  std::string color_profile() const override { return foreign_chromaticities(file_.header()); }
  RawImage decode() override try {
    const std::vector<std::string> names = chosen_channels(path_, file_.header().channels());
    RawImage image{width(), height(), static_cast<int>(names.size()), {}};
    std::vector<float> numbers = data_numbers(names);
    image.numbers = data_ == display_ ? std::move(numbers) : placed(numbers, names.size());
    return image;
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    fail_to_read(path_, error.what());
  }

 private:
  // The pixels of the data window.
  std::vector<float> data_numbers(const std::vector<std::string>& names) {
    const std::size_t pixel = names.size() * sizeof(float);
    const std::size_t row = pixel * static_cast<std::size_t>(width_of(data_));
    std::vector<float> numbers(row / sizeof(float) * static_cast<std::size_t>(height_of(data_)));
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < names.size(); ++c) {
      buffer.insert(names[c], Imf::Slice::Make(Imf::FLOAT, numbers.data() + c, data_, pixel, row));
    }
    file_.setFrameBuffer(buffer);
    file_.readPixels(data_.min.y, data_.max.y);
    return numbers;
  }
  // The same in the display window: 0, also of alpha, where the file has no pixels (a renderer that
  // trims what is empty).
  std::vector<float> placed(const std::vector<float>& numbers, std::size_t channels) const {
    std::vector<float> out(channels * static_cast<std::size_t>(width()) *
                           static_cast<std::size_t>(height()));
    const int left = std::max(data_.min.x, display_.min.x);
    const int right = std::min(data_.max.x, display_.max.x);
    if (left > right) return out;
    const auto at = [&](const Imath::Box2i& window, int y) {
      return static_cast<std::ptrdiff_t>(channels) *
             (std::ptrdiff_t{y - window.min.y} * width_of(window) + left - window.min.x);
    };
    const std::ptrdiff_t count = static_cast<std::ptrdiff_t>(channels) * (right - left + 1);
    for (int y = std::max(data_.min.y, display_.min.y); y <= std::min(data_.max.y, display_.max.y);
         ++y) {
      const auto from = numbers.begin() + at(data_, y);
      std::copy(from, from + count, out.begin() + at(display_, y));
    }
    return out;
  }

  std::string path_;
  Imf::InputFile file_;
  Imath::Box2i data_, display_;
};

class MemoryStream : public Imf::OStream {
 public:
  MemoryStream() : OStream("memory") {}
  void write(const char bytes[], int count) override {
    const auto size = static_cast<std::size_t>(count);
    if (at_ + size > bytes_.size()) bytes_.resize(at_ + size);
    std::memcpy(bytes_.data() + at_, bytes, size);
    at_ += size;
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t at) override { at_ = at; }
  std::vector<unsigned char> take() { return std::move(bytes_); }

 private:
  std::vector<unsigned char> bytes_;
  std::size_t at_ = 0;
};

}  // namespace

std::unique_ptr<ImageDecoder> open_exr(const std::string& path) {
  check_header(path);
  try {
    return std::make_unique<ExrDecoder>(path);
  } catch (const std::exception& error) {
    fail_to_read(path, error.what());
  }
}

PhotoColors exr_colors(const std::string& path) {
  try {
    const Imf::InputFile file(path.c_str());
    const auto says = [&file](const char* name, const char* value) {
      const auto* text = file.header().findTypedAttribute<Imf::StringAttribute>(name);
      return text != nullptr && text->value() == value;
    };
    return {!says(kColorSpace, kDisplay), !says(kAlpha, kStraight)};
  } catch (const std::exception& error) {
    fail_to_read(path, error.what());
  }
}

std::vector<unsigned char> encode_exr(const std::filesystem::path& path,
                                      const Image& image,
                                      const ImageEncoding& encoding) try {
  Imf::Header header(image.width, image.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  // Rec. 709, said aloud; the curve has no attribute of OpenEXR's own, which takes light for
  // granted, but one that OpenImageIO and what is built on it read.
  Imf::addChromaticities(header, Imf::Chromaticities());
  if (!encoding.color_space.empty())
    header.insert(kColorSpace, Imf::StringAttribute(encoding.color_space));
  header.insert(kAlpha, Imf::StringAttribute(kStraight));
  Imf::FrameBuffer buffer;
  const std::size_t pixel = static_cast<std::size_t>(image.channels) * sizeof(float);
  for (std::size_t c = 0; c < encoding.channel_names.size(); ++c) {
    const std::string& name = encoding.channel_names[c];
    header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    // Slices are for reading too, so they want bytes that may change.
    char* first = const_cast<char*>(reinterpret_cast<const char*>(image.data.data() + c));
    buffer.insert(
        name, Imf::Slice(Imf::FLOAT, first, pixel, pixel * static_cast<std::size_t>(image.width)));
  }
  MemoryStream stream;
  {
    Imf::OutputFile file(stream, header);
    file.setFrameBuffer(buffer);
    file.writePixels(image.height);
  }
  return stream.take();
} catch (const std::exception& error) {
  throw DataError(fmt::format("The image {} cannot be written: {}", path.string(), error.what()));
}

}  // namespace raysplats::io
