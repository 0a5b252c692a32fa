// SPDX-License-Identifier: Apache-2.0
#include "images/network.hpp"

#include <fmt/format.h>

#include "raysplats/error.hpp"

#ifdef RAYSPLATS_HAVE_OPENCV
#include <cmath>
#include <opencv2/dnn.hpp>
#endif

namespace raysplats::io {

#ifdef RAYSPLATS_HAVE_OPENCV

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

class DnnNetwork : public PerceptualNetwork {
 public:
  explicit DnnNetwork(const std::filesystem::path& path) : path_(path) {
    try {
      net_ = cv::dnn::readNetFromONNX(path.string());
      // Inputs are set by position: whatever the file calls them, the first two get these names.
      net_.setInputsNames({"in0", "in1"});
    } catch (const cv::Exception& error) {
      throw DataError(
          fmt::format("{} is no network that OpenCV can read ({}); export LPIPS as ONNX",
                      path.string(), error.err));
    }
  }

  double distance(const Image& image, const Image& photo) override {
    cv::Mat out;
    try {
      net_.setInput(to_blob(image), "in0");
      net_.setInput(to_blob(photo), "in1");
      out = net_.forward();
    } catch (const cv::Exception& error) {
      throw DataError(fmt::format(
          "The LPIPS network {} fails on images of {}x{} ({}); it has to take two inputs "
          "(1, 3, height, width)",
          path_.string(), image.width, image.height, error.err));
    }
    if (out.total() != 1 || out.type() != CV_32F || !std::isfinite(*out.ptr<float>())) {
      throw DataError(
          fmt::format("The LPIPS network {} yields {} values instead of one finite number",
                      path_.string(), out.total()));
    }
    return static_cast<double>(*out.ptr<float>());
  }

 private:
  std::filesystem::path path_;
  cv::dnn::Net net_;
};

}  // namespace

bool networks_available() { return true; }

std::unique_ptr<PerceptualNetwork> load_network(const std::filesystem::path& path) {
  return std::make_unique<DnnNetwork>(path);
}

#else

bool networks_available() { return false; }

std::unique_ptr<PerceptualNetwork> load_network(const std::filesystem::path& path) {
  throw UsageError(
      fmt::format("LPIPS with {} needs OpenCV, and this build has none; install libopencv-dnn-dev "
                  "and build again",
                  path.string()));
}

#endif

}  // namespace raysplats::io
