// SPDX-License-Identifier: Apache-2.0
// The library raysplats-images: EXR by OpenEXR, other pictures by OpenImageIO.
#include <OpenEXR/ImfTestFile.h>
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "images/exr_codec.hpp"
#include "images/library_reason.hpp"
#include "images/network.hpp"
#include "io/image/display_byte.hpp"
#include "io/image/image_codec.hpp"
#include "io/image/image_limits.hpp"
#include "io/image/images_interface.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

std::vector<std::uint8_t> to_bytes(const Image& image, int channels) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(image.pixels() * static_cast<std::size_t>(channels));
  for (std::size_t pixel = 0; pixel < image.pixels(); ++pixel) {
    const float* values = &image.data[pixel * static_cast<std::size_t>(image.channels)];
    for (int c = 0; c < channels; ++c) bytes.push_back(display_byte(values[c]));
  }
  return bytes;
}

// Straight alpha as in the file: OpenImageIO multiplies it into PNG and TIFF colours otherwise.
OIIO::ImageSpec straight_config() {
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  return config;
}

class OiioDecoder : public ImageDecoder {
 public:
  OiioDecoder(const std::string& format, std::string name, std::span<const std::byte> memory)
      : name_(std::move(name)), input_(OIIO::ImageInput::create(format)) {
    if (!memory.empty()) {
      memory_ = std::make_unique<OIIO::Filesystem::IOMemReader>(memory.data(), memory.size());
    }
    if (!input_ || (memory_ && !input_->set_ioproxy(memory_.get()))) {
      throw DataError(
          fmt::format("The image {} cannot be read: OpenImageIO is built without {}, convert it to "
                      "PNG or JPEG",
                      name_, format));
    }
    OIIO::ImageSpec spec;
    if (!input_->open(name_, spec, straight_config())) {
      fail_to_read(name_, input_->geterror());
    }
    const bool flat = spec.nchannels >= 1 && spec.depth <= 1 && !spec.deep;
    require_bearable_size(name_, flat ? spec.width : 0, spec.height);
    // OpenImageIO gives the numbers of L*a*b* as if they were red, green and blue.
    const std::string space(spec.get_string_attribute("tiff:ColorSpace"));
    if (space == "CIELAB" || space == "ICCLAB" || space == "ITULAB" || space == "LOGLUV") {
      throw DataError(fmt::format(
          "The image {} holds {} colours, which are not read: convert it to RGB", name_, space));
    }
  }

  int width() const override { return input_->spec().width; }
  int height() const override { return input_->spec().height; }
  int sample_bytes() const override {
    const unsigned char type = input_->spec().format.basetype;
    return type == OIIO::TypeDesc::UINT8 ? 1 : type == OIIO::TypeDesc::UINT16 ? 2 : 4;
  }
  int orientation() const override { return input_->spec().get_int_attribute("Orientation", 1); }
  std::string color_profile() const override {
    const OIIO::ImageSpec& spec = input_->spec();
    if (spec.get_string_attribute("ICCProfile:color_space") != "RGB") return {};
    return std::string(spec.get_string_attribute("ICCProfile:profile_description"));
  }
  RawImage decode() override {
    switch (sample_bytes()) {
      case 1:
        return decode_as<std::uint8_t>(OIIO::TypeUInt8);
      case 2:
        return decode_as<std::uint16_t>(OIIO::TypeUInt16);
      default:
        return decode_as<float>(OIIO::TypeFloat);
    }
  }
  double greatest_integer() const override {
    const OIIO::TypeDesc type = input_->spec().format;
    if (sample_bytes() < 4 || type.is_floating_point()) return 0.0;
    return std::exp2(8 * static_cast<int>(type.basesize()) - (type.is_signed() ? 1 : 0)) - 1.0;
  }

 private:
  bool is_tiff() const { return std::string_view(input_->format_name()) == "tiff"; }
  // Planes one after the other: rows of all of them are far apart, and what is compressed cannot be
  // read to and fro.
  bool has_planes() const {
    return is_tiff() && input_->spec().get_string_attribute("planarconfig") == "separate";
  }
  // OpenImageIO 2.4 reads many rows of a TIFF at once as strips, and says that it has those that
  // the file lacks or zlib refuses; of single rows it tells.
  bool has_strips() const { return is_tiff() && input_->spec().tile_width == 0 && !has_planes(); }

  // Bands that are neither colours nor alpha (near infrared of drones) are left out.
  template <class T>
  RawImage decode_as(const OIIO::TypeDesc& type) {
    const int bands = input_->spec().nchannels;
    // OpenImageIO 2.4 says that the fourth of a GIF's four channels is number 4.
    const int alpha = std::min(input_->spec().alpha_channel, bands - 1);
    const int colors = bands - (alpha > 0 ? 1 : 0) < 3 ? 1 : 3;
    const bool covered = alpha >= colors;
    RawImage image{width(), height(), colors + (covered ? 1 : 0), {}};
    std::vector<T> numbers(image.count());
    const bool at_once = alpha == colors;
    const OIIO::stride_t pixel = static_cast<OIIO::stride_t>(sizeof(T)) * image.channels;
    const auto read = [&](int first, int last, T* to) {
      if (!has_strips()) {
        const bool done = input_->read_image(0, 0, first, last, type, to, pixel);
        return done && !(has_planes() && input_->has_error());
      }
      bool done = true;
      for (int y = 0; done && y < height(); ++y, to += width() * image.channels) {
        const int row = input_->spec().y + y;
        done = input_->read_scanlines(0, 0, row, row + 1, 0, first, last, type, to, pixel);
      }
      return done;
    };
    if (!read(0, at_once ? colors + 1 : colors, numbers.data()) ||
        (covered && !at_once && !read(alpha, alpha + 1, numbers.data() + colors))) {
      fail_to_read(name_, input_->geterror());
    }
    image.numbers = std::move(numbers);
    return image;
  }

  std::string name_;
  std::unique_ptr<OIIO::Filesystem::IOMemReader> memory_;  // outlives the input
  std::unique_ptr<OIIO::ImageInput> input_;
};

class OiioGif : public MovieEncoder {
 public:
  OiioGif(const std::filesystem::path& path, int width, int height, double fps)
      : path_(path.string()),
        spec_(width, height, 3, OIIO::TypeUInt8),
        output_(OIIO::ImageOutput::create("gif")) {
    spec_.attribute("oiio:Movie", 1);
    spec_.attribute("gif:Interlacing", 0);
    spec_.attribute("FramesPerSecond", static_cast<float>(fps));
  }
  void add(const Image& frame) override {
    using Mode = OIIO::ImageOutput::OpenMode;
    const Mode mode = first_ ? OIIO::ImageOutput::Create : OIIO::ImageOutput::AppendSubimage;
    require(output_ && output_->open(path_, spec_, mode));
    first_ = false;
    require(output_->write_image(OIIO::TypeUInt8, to_bytes(frame, 3).data()));
  }
  void finish() override { require(output_ && output_->close()); }

 private:
  void require(bool done) {
    if (done) return;
    throw DataError(fmt::format(
        "The video {} cannot be written: {}", path_,
        output_ ? library_reason(path_, output_->geterror()) : "OpenImageIO lacks the format GIF"));
  }
  std::string path_;
  OIIO::ImageSpec spec_;
  std::unique_ptr<OIIO::ImageOutput> output_;
  bool first_ = true;
};

class OiioCodec : public ImageCodec {
 public:
  std::unique_ptr<ImageDecoder> open(const std::string& format,
                                     const std::string& name,
                                     std::span<const std::byte> memory) const override {
    if (format == "openexr") return open_exr(name);
    return std::make_unique<OiioDecoder>(format, name, memory);
  }
  PhotoColors photo_colors(const std::string& path) const override {
    if (Imf::isOpenExrFile(path.c_str())) return exr_colors(path);
    const OIIO::ImageSpec config = straight_config();
    const auto input = OIIO::ImageInput::open(path, &config);
    if (!input) {
      fail_to_read(path, OIIO::geterror());
    }
    const std::string_view format = input->format_name();
    // TIFF tells whether alpha multiplies; that of WebP does not, but OpenImageIO 2.4 multiplies it
    // in whatever it is asked for.
    const bool multiplies = format == "tiff" || format == "webp";
    return {format == "hdr", multiplies && input->spec().alpha_channel >= 0 &&
                                 input->spec().get_int_attribute("oiio:UnassociatedAlpha") == 0};
  }
  std::vector<unsigned char> encode(const std::filesystem::path& path,
                                    const Image& image,
                                    const ImageEncoding& encoding) const override {
    if (encoding.format == "openexr") return encode_exr(path, image, encoding);
    const bool jpeg = encoding.format == "jpeg";
    // JPEG has neither alpha nor grey with alpha.
    const int channels = jpeg ? (image.channels >= 3 ? 3 : 1) : image.channels;
    OIIO::ImageSpec spec(image.width, image.height, channels, OIIO::TypeUInt8);
    spec.attribute("oiio:UnassociatedAlpha", 1);
    if (jpeg) {
      spec.attribute("Compression", fmt::format("jpeg:{}", encoding.quality));
      spec.attribute("jpeg:subsampling", encoding.quality < 90 ? "4:2:0" : "4:4:4");
    }
    // Encoded in memory: OpenImageIO's encoders miss a full disk, and libjpeg ends the process on
    // one.
    const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(encoding.format);
    OIIO::Filesystem::IOVecOutput encoded;
    const bool written =
        output && output->set_ioproxy(&encoded) && output->open(path.string(), spec) &&
        output->write_image(OIIO::TypeUInt8, to_bytes(image, channels).data()) && output->close();
    if (!written) {
      throw DataError(fmt::format("The image {} cannot be written: {}", path.string(),
                                  output ? library_reason(path.string(), output->geterror())
                                         : "OpenImageIO lacks the format"));
    }
    return encoded.buffer();
  }
  std::unique_ptr<MovieEncoder> open_gif(const std::filesystem::path& path,
                                         int width,
                                         int height,
                                         double fps) const override {
    return std::make_unique<OiioGif>(path, width, height, fps);
  }
  bool has_networks() const override { return networks_available(); }
  std::unique_ptr<PerceptualNetwork> open_network(
      const std::filesystem::path& path) const override {
    return load_network(path);
  }
};

}  // namespace
}  // namespace raysplats::io

extern "C" const char* raysplats_images_version() { return RAYSPLATS_VERSION; }

extern "C" std::uint64_t raysplats_images_interface() { return raysplats::io::kImagesInterface; }

extern "C" const raysplats::io::ImageCodec* raysplats_images_codec() {
  static const raysplats::io::OiioCodec codec;
  return &codec;
}
