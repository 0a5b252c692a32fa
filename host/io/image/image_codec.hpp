// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/image.hpp"

namespace raysplats::io {

/// A picture as its file has it: row by row, 8 bits a number (of 255), 16 bits (of 65535) or
/// floats.
struct RawImage {
  using Numbers =
      std::variant<std::vector<std::uint8_t>, std::vector<std::uint16_t>, std::vector<float>>;

  int width = 0;
  int height = 0;
  int channels = 0;  ///< at most 4; alpha is straight
  Numbers numbers;   ///< height x width x channels

  std::size_t count() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
           static_cast<std::size_t>(channels);
  }
};

/// As read_image() gives it; takes the floats of one that has them.
Image to_image(RawImage raw);

/// What the colours of a photo's file are, beyond their numbers: as a rule display values that
/// alpha does not multiply.
struct PhotoColors {
  bool light = false;       ///< proportional to light
  bool associated = false;  ///< multiplied by alpha
};

/// An opened picture.
class ImageDecoder {
 public:
  virtual ~ImageDecoder() = default;
  virtual int width() const = 0;
  virtual int height() const = 0;
  /// Bytes of a number that decode() gives: 1, 2 or 4.
  virtual int sample_bytes() const = 0;
  /// As EXIF counts; 1 is upright.
  virtual int orientation() const { return 1; }
  /// The name of the ICC profile that says what its red, green and blue are, of an EXR their
  /// chromaticities where those are not sRGB's; "" where the file has none.
  virtual std::string color_profile() const { return {}; }
  /// Throws DataError.
  virtual RawImage decode() = 0;
  /// Of integers that decode() gives as floats, the greatest that their type has, which is 1 there;
  /// 0 of other numbers.
  virtual double greatest_integer() const { return 0.0; }
};

/// A network that compares pictures; see Lpips.
class PerceptualNetwork {
 public:
  virtual ~PerceptualNetwork() = default;
  virtual double distance(const Image& image, const Image& photo) = 0;
};

/// How a picture is stored.
struct ImageEncoding {
  std::string format;                      ///< "png", "jpeg" or "openexr"
  std::vector<std::string> channel_names;  ///< of "openexr"
  std::string color_space;  ///< of "openexr": what "oiio:ColorSpace" says; may be empty
  int quality = 95;         ///< of "jpeg", to 100; below 90 colours have half the resolution
};

/// A picture that moves, written frame by frame.
class MovieEncoder {
 public:
  virtual ~MovieEncoder() = default;
  /// RGB of the size given at the start. Throws DataError.
  virtual void add(const Image& frame) = 0;
  virtual void finish() = 0;
};

/// What the library raysplats-images does: formats of pictures and networks. Everything behind it
/// (OpenImageIO, OpenEXR, OpenCV) drags in some hundreds of shared libraries, so it lies in a
/// library of its own that is loaded when the first picture is opened.
class ImageCodec {
 public:
  virtual ~ImageCodec() = default;
  /// `format`: "png", "jpeg", "openexr", "webp", "bmp", "hdr", "tiff", "gif", "targa" or "heif", of
  /// which the first picture counts. `name` is the path, or
  /// stands for it in errors where `memory` (not of "openexr"), which has to outlive the decoder,
  /// is not empty. Throws DataError for what is no flat picture of a bearable size.
  virtual std::unique_ptr<ImageDecoder> open(const std::string& format,
                                             const std::string& name,
                                             std::span<const std::byte> memory) const = 0;
  /// Of a file that decodes, for photos, which become straight display values, and for textures and
  /// environments (read_texture()): depth maps and masks are the numbers of their files. Throws
  /// DataError.
  virtual PhotoColors photo_colors(const std::string& path) const {
    static_cast<void>(path);
    return {};
  }
  /// The bytes of a file, 8-bit for "png" and "jpeg". Throws DataError that names `path`.
  virtual std::vector<unsigned char> encode(const std::filesystem::path& path,
                                            const Image& image,
                                            const ImageEncoding& encoding) const = 0;
  /// A GIF that repeats for ever. Throws DataError that names `path`, UsageError where there is no
  /// encoder.
  virtual std::unique_ptr<MovieEncoder> open_gif(const std::filesystem::path& path,
                                                 int width,
                                                 int height,
                                                 double fps) const {
    static_cast<void>(path), static_cast<void>(width), static_cast<void>(height);
    static_cast<void>(fps);
    throw UsageError("This build has no encoder for GIF: use another format");
  }
  /// Whether networks can be run, and one of an ONNX file. Throws DataError, UsageError.
  virtual bool has_networks() const = 0;
  virtual std::unique_ptr<PerceptualNetwork> open_network(
      const std::filesystem::path& path) const = 0;
};

/// The codec, loaded by the first call. Throws Error(kRuntime) when the library is not there, is of
/// another version or has another interface.
const ImageCodec& image_codec();

}  // namespace raysplats::io

/// What raysplats-images exports: the version that it was built with, its interface
/// (io/image/images_interface.hpp), and the codec.
extern "C" const char* raysplats_images_version();
extern "C" std::uint64_t raysplats_images_interface();
extern "C" const raysplats::io::ImageCodec* raysplats_images_codec();
