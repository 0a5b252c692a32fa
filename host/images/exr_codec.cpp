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
#include <array>
#include <cstdint>
#include <cstring>
#include <exception>
#include <initializer_list>
#include <utility>

#include "io/image_limits.hpp"
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

// "path: what", without the path.
std::string reason(const std::string& path, std::string text) {
  for (std::size_t at; (at = text.find(path)) != std::string::npos;) text.erase(at, path.size());
  std::replace(text.begin(), text.end(), '\n', ' ');
  const std::size_t begin = text.find_first_not_of(" :'\"");
  return begin == std::string::npos ? "its data are damaged" : text.substr(begin);
}

[[noreturn]] void fail_to_read(const std::string& path, const std::string& what) {
  throw DataError(fmt::format("The image {} cannot be read: {}", path, reason(path, what)));
}

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
  exr_attr_box2i_t window{};
  file.check(exr_get_data_window(file.get(), kPart, &window));
  require_bearable_size(path, std::int64_t{window.max.x} - window.min.x + 1,
                        std::int64_t{window.max.y} - window.min.y + 1);
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
  if (channels.findChannel("R") != nullptr || channels.findChannel("G") != nullptr ||
      channels.findChannel("B") != nullptr) {
    take("", {"R", "G", "B", "A"});
  } else if (channels.findChannel("Y") != nullptr) {
    take("", {"Y", "A"});
  } else if (const std::string layer = chosen_layer(channels); !layer.empty()) {
    take(layer, {"R", "G", "B", "A"});
  }
  if (!names.empty()) return names;
  const std::size_t more = all.size() - std::min(all.size(), kNamed);
  all.resize(all.size() - more);
  throw DataError(fmt::format(
      "The image {} has the channels {}{} and none of colours among them: it must have R, G and B, "
      "of a layer or without, or Y, or one channel alone",
      path, fmt::join(all, ", "), more > 0 ? fmt::format(" and {} more", more) : ""));
}

class ExrDecoder : public ImageDecoder {
 public:
  explicit ExrDecoder(const std::string& path)
      : path_(path), file_(path.c_str()), window_(file_.header().dataWindow()) {}

  int width() const override { return window_.max.x - window_.min.x + 1; }
  int height() const override { return window_.max.y - window_.min.y + 1; }
  int sample_bytes() const override { return sizeof(float); }
  RawImage decode() override try {
    const std::vector<std::string> names = chosen_channels(path_, file_.header().channels());
    RawImage image{width(), height(), static_cast<int>(names.size()), {}};
    std::vector<float> numbers(image.count());
    const std::size_t pixel = names.size() * sizeof(float);
    const std::size_t row = pixel * static_cast<std::size_t>(image.width);
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < names.size(); ++c) {
      buffer.insert(names[c],
                    Imf::Slice::Make(Imf::FLOAT, numbers.data() + c, window_, pixel, row));
    }
    file_.setFrameBuffer(buffer);
    file_.readPixels(window_.min.y, window_.max.y);
    image.numbers = std::move(numbers);
    return image;
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw DataError(
        fmt::format("The image {} cannot be decoded: {}", path_, reason(path_, error.what())));
  }

 private:
  std::string path_;
  Imf::InputFile file_;
  Imath::Box2i window_;
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
