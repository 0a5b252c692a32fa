// SPDX-License-Identifier: Apache-2.0
// Pictures reach the library by functions of Python (io/image/image_codec.hpp): by default
// Pillow's.
#include "images.hpp"

#include <fmt/format.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <pthread.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <utility>

#include "bindings.hpp"
#include "io/image/image_codec.hpp"
#include "io/image/image_header.hpp"
#include "io/image/image_limits.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "signals.hpp"

namespace raysplats::python {
namespace {

/// The functions in use, until the interpreter ends.
struct Functions {
  PyObject* read = nullptr;
  PyObject* encode = nullptr;
};
Functions functions;

/// Threads of the library call the functions too, such as those that read photos ahead for a
/// Trainer. Once the interpreter ends, Python stops any thread that wants its lock in the middle of
/// C++, which aborts the process. So the end waits for calls under way, and there are none after.
std::atomic<int> calls = 0;
std::atomic<bool> ending = false;

class Call {
 public:
  explicit Call(const std::string& image) {
    ++calls;
    if (!ending) return;
    --calls;
    throw UsageError(fmt::format(
        "The image {} cannot be read or written: the program ends, and Python with it", image));
  }
  ~Call() { --calls; }
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;
};

void end_calls() {
  ending = true;
  {
    const nb::gil_scoped_release release;
    while (calls > 0) {
      heed_signals(0);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  // A function of the program holds its module, and so whatever that has.
  Py_CLEAR(functions.read);
  Py_CLEAR(functions.encode);
}

/// The sentence of a failure that Python reports; the interpreter's lock is held.
std::string sentence(const nb::python_error& error) {
  return nb::cast<std::string>(nb::str(error.value()));
}

bool is_control_flow(const nb::python_error& error) { return !error.matches(PyExc_Exception); }

class PythonDecoder : public io::ImageDecoder {
 public:
  explicit PythonDecoder(Image image) : image_(std::move(image)) {}
  int width() const override { return image_.width; }
  int height() const override { return image_.height; }
  int sample_bytes() const override { return sizeof(float); }
  io::RawImage decode() override {
    return {image_.width, image_.height, image_.channels, std::move(image_.data)};
  }

 private:
  Image image_;
};

class PythonCodec : public io::ImageCodec {
 public:
  std::unique_ptr<io::ImageDecoder> open(const std::string& format,
                                         const std::string& name,
                                         std::span<const std::byte> memory) const override {
    if (memory.empty()) {
      if (const auto size = io::size_in_header(name, format)) {
        io::require_bearable_size(name, size->width, size->height);
      }
    }
    const Call call(name);
    const nb::gil_scoped_acquire acquire;
    try {
      nb::object source = memory.empty() ? nb::object(nb::str(name.c_str()))
                                         : nb::object(nb::bytes(memory.data(), memory.size()));
      const nb::object array = nb::borrow(functions.read)(source, format);
      Image image = image_of(FloatArray{array}, "the picture");
      io::require_bearable_size(name, image.width, image.height);
      return std::make_unique<PythonDecoder>(std::move(image));
    } catch (const nb::python_error& error) {
      if (is_control_flow(error)) throw;
      throw DataError(fmt::format("The image {} cannot be read: {}", name, sentence(error)));
    } catch (const nb::builtin_exception& error) {
      throw DataError(fmt::format("The image {} cannot be read: {}", name, error.what()));
    }
  }

  std::vector<unsigned char> encode(const std::filesystem::path& path,
                                    const Image& image,
                                    const io::ImageEncoding& encoding) const override {
    const Call call(path.string());
    const nb::gil_scoped_acquire acquire;
    try {
      const nb::object bytes = nb::borrow(functions.encode)(
          array_of(image), encoding.format, encoding.channel_names, encoding.color_space);
      const auto encoded = nb::cast<nb::bytes>(bytes);
      const auto* begin = reinterpret_cast<const unsigned char*>(encoded.c_str());
      return {begin, begin + encoded.size()};
    } catch (const nb::python_error& error) {
      if (is_control_flow(error)) throw;
      throw DataError(
          fmt::format("The image {} cannot be written: {}", path.string(), sentence(error)));
    } catch (const nb::cast_error&) {
      throw DataError(
          fmt::format("The image {} cannot be written: the function of set_image_functions() gave "
                      "no bytes",
                      path.string()));
    }
  }

  bool has_networks() const override { return false; }
  std::unique_ptr<io::PerceptualNetwork> open_network(
      const std::filesystem::path& path) const override {
    throw UsageError(
        fmt::format("The network {} cannot be run: raysplats for Python is built without OpenCV",
                    path.string()));
  }
};

void set_functions(const nb::callable& read, const nb::callable& encode) {
  Py_XDECREF(std::exchange(functions.read, read.inc_ref().ptr()));
  Py_XDECREF(std::exchange(functions.encode, encode.inc_ref().ptr()));
}

}  // namespace

Image image_of(const FloatArray& array, const char* name) {
  const bool flat =
      nb::hasattr(array.value, "ndim") && nb::cast<int>(nb::object(array.value.attr("ndim"))) == 2;
  const Numbers<float> given =
      numbers(array, name, flat ? Shape{kAny, kAny} : Shape{kAny, kAny, kAny});
  constexpr std::size_t kMaxChannels = 4;
  const std::size_t count = flat ? 1 : given.shape[2];
  if (count < 1 || count > kMaxChannels) {
    throw UsageError(fmt::format("{} has {} channels, but 1 to 4 are needed", name, count));
  }
  io::require_bearable_size(name, static_cast<std::int64_t>(given.shape[1]),
                            static_cast<std::int64_t>(given.shape[0]));
  Image image;
  image.height = static_cast<int>(given.shape[0]);
  image.width = static_cast<int>(given.shape[1]);
  image.channels = static_cast<int>(count);
  image.data = given.copy();
  return image;
}

FloatView array_of(Image image) {
  return array_of(std::move(image.data),
                  {static_cast<std::size_t>(image.height), static_cast<std::size_t>(image.width),
                   static_cast<std::size_t>(image.channels)});
}

void bind_images(nb::module_& module) {
  nb::module_::import_("atexit").attr("register")(nb::cpp_function(&end_calls));
  // A child by fork does not have the threads that are in calls.
  ::pthread_atfork(nullptr, nullptr, [] { calls = 0; });
  module.def(
      "set_image_functions", &set_functions, nb::arg("read"), nb::arg("encode"),
      "Functions that pictures are read and written by. read(source, format) takes a path or "
      "bytes and 'png', 'jpeg', 'openexr', 'webp', 'bmp', 'hdr' or 'tiff', and returns an "
      "array of float32 (height, width, channels), 8-bit values divided by 255, straight "
      "alpha; encode(array, format, channel_names, color_space) returns the bytes of a 'png', "
      "'jpeg' or 'openexr' file.");
  module.def(
      "read_image",
      [](const std::filesystem::path& path) {
        Image image;
        {
          const nb::gil_scoped_release release;
          image = read_image(path);
        }
        return array_of(std::move(image));
      },
      nb::arg("path"), "A picture as float32 (height, width, channels); 8-bit values over 255.");
  module.def(
      "write_image",
      [](const std::filesystem::path& path, const FloatArray& image) {
        const Image copy = image_of(image, "image");
        const nb::gil_scoped_release release;
        write_image(path, copy);
      },
      nb::arg("path"), nb::arg("image"),
      "Writes .png, .jpg or .exr by the extension; 8-bit formats clamp to [0, 1] and round.");
}

}  // namespace raysplats::python

extern "C" const raysplats::io::ImageCodec* raysplats_images_codec() {
  static const raysplats::python::PythonCodec codec;
  return &codec;
}
