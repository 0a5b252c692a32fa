// SPDX-License-Identifier: Apache-2.0
#include "eval/lpips.hpp"

#include <fmt/format.h>

#include "raysplats/error.hpp"

#ifdef RAYSPLATS_HAVE_OPENCV
#include <cmath>
#include <opencv2/dnn.hpp>
#endif

namespace raysplats {

#ifdef RAYSPLATS_HAVE_OPENCV

struct Lpips::Impl {
  std::filesystem::path path;
  cv::dnn::Net net;
};

namespace {

// (1, 3, height, width) in [-1, 1].
cv::Mat to_blob(const Image& image) {
  const int sizes[] = {1, 3, image.height, image.width};
  cv::Mat blob(4, sizes, CV_32F);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < image.height; ++y) {
      float* row = blob.ptr<float>(0, c, y);
      for (int x = 0; x < image.width; ++x) row[x] = 2.0f * image.at(x, y, c) - 1.0f;
    }
  }
  return blob;
}

}  // namespace

bool Lpips::available() { return true; }

Lpips::Lpips(const std::filesystem::path& network) : impl_(std::make_unique<Impl>()) {
  impl_->path = network;
  if (!std::filesystem::is_regular_file(network)) {
    throw DataError(fmt::format(
        "The LPIPS network {} does not exist; give the path of an ONNX file", network.string()));
  }
  try {
    impl_->net = cv::dnn::readNetFromONNX(network.string());
    // Inputs are set by position: whatever the file calls them, the first two get these names.
    impl_->net.setInputsNames({"in0", "in1"});
  } catch (const cv::Exception& error) {
    throw DataError(fmt::format("{} is no network that OpenCV can read ({}); export LPIPS as ONNX",
                                network.string(), error.err));
  }
}

double Lpips::distance(const Image& image, const Image& photo) {
  if (image.width != photo.width || image.height != photo.height || image.channels < 3 ||
      photo.channels < 3) {
    throw UsageError(fmt::format(
        "LPIPS compares RGB images of equal size; these are {}x{}x{} and {}x{}x{}", image.width,
        image.height, image.channels, photo.width, photo.height, photo.channels));
  }
  cv::Mat out;
  try {
    impl_->net.setInput(to_blob(image), "in0");
    impl_->net.setInput(to_blob(photo), "in1");
    out = impl_->net.forward();
  } catch (const cv::Exception& error) {
    throw DataError(
        fmt::format("The LPIPS network {} fails on images of {}x{} ({}); it has to take two inputs "
                    "(1, 3, height, width)",
                    impl_->path.string(), image.width, image.height, error.err));
  }
  if (out.total() != 1 || out.type() != CV_32F || !std::isfinite(*out.ptr<float>())) {
    throw DataError(
        fmt::format("The LPIPS network {} yields {} values instead of one finite number",
                    impl_->path.string(), out.total()));
  }
  return static_cast<double>(*out.ptr<float>());
}

#else

struct Lpips::Impl {};

bool Lpips::available() { return false; }

Lpips::Lpips(const std::filesystem::path& network) {
  throw UsageError(
      fmt::format("LPIPS with {} needs OpenCV, and this build has none; install libopencv-dnn-dev "
                  "and build again",
                  network.string()));
}

double Lpips::distance(const Image&, const Image&) {
  throw UsageError("LPIPS needs a build with OpenCV");
}

#endif

Lpips::~Lpips() = default;
Lpips::Lpips(Lpips&&) noexcept = default;
Lpips& Lpips::operator=(Lpips&&) noexcept = default;

}  // namespace raysplats
