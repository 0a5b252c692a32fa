// SPDX-License-Identifier: Apache-2.0
#include "images/network.hpp"

#include <fmt/format.h>

#include "raysplats/error.hpp"

#ifdef RAYSPLATS_HAVE_OPENCV
#include <cmath>
#include <map>
#include <opencv2/dnn.hpp>
#include <opencv2/dnn/all_layers.hpp>
#include <string>
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

constexpr const char* kRemedy = "export it with scripts/quality/export_lpips.py of the sources";

// Throws DataError for what OpenCV reads without an error but computes wrongly (4.6; later versions
// in part), both of which an export of LPIPS as it is has.
void refuse_misread_layers(cv::dnn::Net& net, const std::filesystem::path& path) {
  std::map<const unsigned char*, std::string> factors;  // the layer that has each
  for (const std::string& name : net.getLayerNames()) {
    const cv::Ptr<cv::dnn::Layer> layer = net.getLayer(net.getLayerId(name));
    // It keeps the shapes that its input had when the file was written.
    if (layer->type == "Reduce") {
      throw DataError(
          fmt::format("The LPIPS network {} takes a mean or a sum ({}) that OpenCV computes for "
                      "pictures of one size only: {}",
                      path.string(), name, kRemedy));
    }
    // A division becomes a product: the constant is inverted where it lies, once for each division
    // by it. Constants that are added become layers of this kind too.
    const auto scale = layer.dynamicCast<cv::dnn::ScaleLayer>();
    if (!scale || scale->hasBias || scale->blobs.size() != 1) continue;
    const auto [first, is_new] = factors.try_emplace(scale->blobs[0].data, name);
    if (!is_new) {
      throw DataError(
          fmt::format("The LPIPS network {} divides or multiplies twice by one constant ({}, {}), "
                      "which OpenCV reads wrongly: {}",
                      path.string(), first->second, name, kRemedy));
    }
  }
}

class DnnNetwork : public PerceptualNetwork {
 public:
  explicit DnnNetwork(const std::filesystem::path& path) : path_(path) {
    try {
      net_ = cv::dnn::readNetFromONNX(path.string());
      // Inputs are set by position: whatever the file calls them, the first two get these names.
      net_.setInputsNames({"in0", "in1"});
      refuse_misread_layers(net_, path);
    } catch (const cv::Exception& error) {
      throw DataError(fmt::format("The LPIPS network {} is none that OpenCV can read ({}): {}",
                                  path.string(), error.err, kRemedy));
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
    if (out.total() != 1 || out.type() != CV_32F) {
      throw DataError(fmt::format("The LPIPS network {} yields {} values instead of one float: {}",
                                  path_.string(), out.total(), kRemedy));
    }
    if (!std::isfinite(*out.ptr<float>())) {
      throw DataError(
          fmt::format("The LPIPS network {} yields no finite number ({}) for images of {}x{}: {}",
                      path_.string(), *out.ptr<float>(), image.width, image.height, kRemedy));
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
