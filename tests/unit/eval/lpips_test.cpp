// SPDX-License-Identifier: Apache-2.0
#include "raysplats/lpips.hpp"

#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "build_paths.hpp"
#include "raysplats/error.hpp"
#include "skip_test.hpp"
#include "unit/temporary_directory.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

// tests/data/tiny_lpips.onnx stands for a real network: the mean square of a 3x3 convolution of the
// difference, weighted 1, 2, 3 for R, G, B. Made with onnx 1.23:
//   import numpy as np, onnx
//   from onnx import helper as h, TensorProto as T, numpy_helper
//   w = np.array([[0,1,0],[1,-4,1],[0,1,0]], np.float32) / 8 + np.eye(3, dtype=np.float32) / 4
//   k = np.zeros((3, 3, 3, 3), np.float32)
//   for c in range(3): k[c, c] = w * (c + 1)
//   f = lambda n: h.make_tensor_value_info(n, T.FLOAT, [1, 3, "h", "w"])
//   nodes = [h.make_node("Sub", ["in0", "in1"], ["d"]),
//            h.make_node("Conv", ["d", "k"], ["e"], kernel_shape=[3, 3], pads=[1, 1, 1, 1]),
//            h.make_node("Mul", ["e", "e"], ["s"]),
//            h.make_node("GlobalAveragePool", ["s"], ["p"]),
//            h.make_node("Conv", ["p", "l"], ["out"], kernel_shape=[1, 1])]
//   g = h.make_graph(nodes, "tiny", [f("in0"), f("in1")],
//                    [h.make_tensor_value_info("out", T.FLOAT, [1, 1, 1, 1])],
//                    [numpy_helper.from_array(k, "k"),
//                     numpy_helper.from_array(np.full((1, 3, 1, 1), 1 / 3, np.float32), "l")])
//   m = h.make_model(g, opset_imports=[h.make_opsetid("", 11)]); m.ir_version = 7
//   onnx.checker.check_model(m); onnx.save(m, "tiny_lpips.onnx")
const std::filesystem::path kData = std::filesystem::path(test::source_dir()) / "tests/data";
const std::filesystem::path kNetwork = kData / "tiny_lpips.onnx";

// Those beside it have what OpenCV gets wrong of LPIPS as its package is: both pictures divided by
// one constant ("divisor"), means of all pixels ("means"). The third ("root") yields no number.
// Made with torch 1.13:
//   import torch
//   import torch.nn.functional as F
//   class Tiny(torch.nn.Module):
//       def __init__(self, kind):
//           super().__init__()
//           self.kind = kind
//           scale = torch.tensor([0.458, 0.448, 0.45])[None, :, None, None]
//           self.register_buffer("scale", scale)
//           self.register_buffer("heads", torch.full((1, 3, 1, 1), 1 / 3))
//       def forward(self, a, b):
//           if self.kind == "divisor": a, b = a / self.scale, b / self.scale
//           error = F.conv2d((a - b)**2, self.heads)
//           if self.kind == "means": return error.mean([2, 3], keepdim=True)
//           mean = F.adaptive_avg_pool2d(error, 1)
//           return torch.sqrt(-1 - mean) if self.kind == "root" else mean
//   for kind in ("divisor", "means", "root"):
//       torch.onnx.export(Tiny(kind), (torch.rand(1, 3, 8, 8), torch.rand(1, 3, 8, 8)),
//                         f"tiny_lpips_{kind}.onnx", opset_version=11)

double expected_distance(const Image& a, const Image& b) {
  constexpr double kKernel[3][3] = {{0.25, 0.125, 0}, {0.125, -0.25, 0.125}, {0, 0.125, 0.25}};
  double sum = 0;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < a.height; ++y) {
      for (int x = 0; x < a.width; ++x) {
        double value = 0;
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            if (x + dx < 0 || y + dy < 0 || x + dx >= a.width || y + dy >= a.height) continue;
            const double d = static_cast<double>(a.at(x + dx, y + dy, c)) -
                             static_cast<double>(b.at(x + dx, y + dy, c));
            // Going from [0, 1] to [-1, 1] doubles differences.
            value += kKernel[dy + 1][dx + 1] * (c + 1) * 2.0 * d;
          }
        }
        sum += value * value;
      }
    }
  }
  return sum / (3.0 * a.width * a.height);
}

// What the networks beside it compute.
double mean_square(const Image& a, const Image& b, bool divided) {
  constexpr double kScale[3] = {0.458, 0.448, 0.45};
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    const double d = 2.0 * (static_cast<double>(a.data[i]) - static_cast<double>(b.data[i])) /
                     (divided ? kScale[i % 3] : 1.0);
    sum += d * d;
  }
  return sum / static_cast<double>(a.data.size());
}

Image random_image(int width, int height, std::uint64_t seed) {
  Image image(width, height, 3);
  CounterRng rng(seed, 0);
  for (float& value : image.data) value = static_cast<float>(rng.uniform());
  return image;
}

}  // namespace

TEST_CASE("lpips: runs a network on images of several sizes") {
  if (!Lpips::available()) CHECK_THROWS_AS(Lpips{kNetwork}, UsageError);
  SKIP_TEST_UNLESS(Lpips::available(), "LPIPS is not part of this build");
  Lpips lpips(kNetwork);
  for (const int width : {16, 9, 33}) {
    const Image a = random_image(width, 12, 1);
    const Image b = random_image(width, 12, 2);
    CHECK(lpips.distance(a, b) == doctest::Approx(expected_distance(a, b)).epsilon(1e-5));
    CHECK(lpips.distance(a, a) == 0.0);
  }
  CHECK_THROWS_AS(lpips.distance(Image(3, 4, 3), Image(4, 3, 3)), UsageError);
}

TEST_CASE("lpips: a missing or broken network is refused") {
  SKIP_TEST_UNLESS(Lpips::available(), "LPIPS is not part of this build");
  CHECK_THROWS_AS(Lpips{"/nonexistent/network.onnx"}, DataError);
  const TemporaryDirectory folder;
  const std::filesystem::path broken = folder / "broken.onnx";
  std::ofstream(broken) << "this is no network";
  CHECK_THROWS_AS(Lpips{broken}, DataError);
}

TEST_CASE("lpips: networks that OpenCV computes wrongly are refused with a remedy") {
  SKIP_TEST_UNLESS(Lpips::available(), "LPIPS is not part of this build");
  const Image a = random_image(9, 12, 1), b = random_image(9, 12, 2);
  for (const char* name : {"divisor", "means", "root"}) {
    CAPTURE(name);
    const std::filesystem::path path = kData / ("tiny_lpips_" + std::string(name) + ".onnx");
    std::string said;
    try {
      Lpips lpips(path);
      const double distance = lpips.distance(a, b);
      // Newer versions of OpenCV read some of them rightly.
      CHECK(std::string(name) != "root");
      CHECK(distance ==
            doctest::Approx(mean_square(a, b, std::string(name) == "divisor")).epsilon(1e-5));
      continue;
    } catch (const DataError& error) {
      said = error.what();
    }
    INFO(said);
    CHECK(said.find(path.string()) != std::string::npos);
    CHECK(said.find("scripts/quality/export_lpips.py") != std::string::npos);
    CHECK((said.find("no finite number") != std::string::npos) == (std::string(name) == "root"));
  }
}

}  // namespace raysplats
