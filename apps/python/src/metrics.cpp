// SPDX-License-Identifier: Apache-2.0
#include "eval/metrics.hpp"

#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "bindings.hpp"
#include "images.hpp"
#include "names.hpp"
#include "pickling.hpp"
#include "raysplats/evaluation.hpp"
#include "signals.hpp"
#include "tuples.hpp"

namespace raysplats::python {
namespace {

template <double Metric(const Image&, const Image&)>
double compare(const FloatArray& image, const FloatArray& photo) {
  const Image first = image_of(image, "image");
  const Image second = image_of(photo, "photo");
  const nb::gil_scoped_release release;
  return Metric(first, second);
}

EvaluationReport evaluate_renders(const nb::callable& render,
                                  const Dataset& dataset,
                                  const std::string& split,
                                  const std::array<float, 3>& background,
                                  const std::optional<std::filesystem::path>& output,
                                  std::size_t max_views,
                                  bool align) {
  EvaluationOptions options;
  options.max_views = max_views;
  options.align = align;
  options.done = [](std::size_t) { return heed_signals(0); };
  const auto call = [&render](const Camera& camera) {
    const nb::gil_scoped_acquire acquire;
    return image_of(FloatArray{render(camera)}, "what render returns");
  };
  const Split part = value_of(kSplits, "split", split);
  const nb::gil_scoped_release release;
  return evaluate(call, dataset, part, background, output.value_or(""), options);
}

void bind_report(nb::module_& module) {
  nb::class_<EvaluationMetrics> metrics(module, "EvaluationMetrics",
                                        "Measures of one view, or their means over views.");
  metrics.def_ro("name", &EvaluationMetrics::name)
      .def_ro("psnr", &EvaluationMetrics::psnr,
              "Decibels, over pixels not masked out; at most 100.")
      .def_ro("ssim", &EvaluationMetrics::ssim)
      .def_ro("psnr_corrected", &EvaluationMetrics::psnr_corrected,
              "PSNR when exposure and white balance do not count.")
      .def_ro("psnr_shifted", &EvaluationMetrics::psnr_shifted,
              "PSNR once the render is shifted in its plane to where it fits the photo best.")
      .def_ro("psnr_all", &EvaluationMetrics::psnr_all,
              "Over all pixels, when some are masked out.")
      .def_ro("psnr_aligned", &EvaluationMetrics::psnr_aligned,
              "PSNR when errors of poses do not count, if asked for.")
      .def_ro("picture", &EvaluationMetrics::picture,
              "Its file in the output folder; empty when none was written.")
      .def_ro("center", &EvaluationMetrics::center, "Of the camera.")
      .def_ro("shift", &EvaluationMetrics::shift, "That of psnr_shifted: pixels right and down.")
      .def_ro("sharpness", &EvaluationMetrics::sharpness,
              "Of the photo, to compare with others of the scene.")
      .def_ro("coarse_sharpness", &EvaluationMetrics::coarse_sharpness,
              "Of the photo reduced to some 24 pixels: whether there is much to be sharp about.");
  using Metrics = EvaluationMetrics;
  def_pickling(metrics, &Metrics::name, &Metrics::psnr, &Metrics::ssim, &Metrics::psnr_corrected,
               &Metrics::psnr_aligned, &Metrics::psnr_all, &Metrics::lpips, &Metrics::picture,
               &Metrics::center, &Metrics::sharpness, &Metrics::coarse_sharpness,
               &Metrics::psnr_shifted, &Metrics::shift);
  nb::class_<EvaluationReport> report(module, "EvaluationReport");
  report.def_ro("mean", &EvaluationReport::mean)
      .def_ro("images", &EvaluationReport::images)
      .def("table", &EvaluationReport::table)
      .def("json", &EvaluationReport::json);
  def_pickling(report, &EvaluationReport::mean, &EvaluationReport::images);
}

}  // namespace

void bind_metrics(nb::module_& module) {
  module.def("psnr", &compare<&psnr>, nb::arg("image"), nb::arg("photo"),
             "Peak signal-to-noise ratio in decibels for a peak of 1; arrays (height, width, "
             "channels).");
  module.def("ssim", &compare<&ssim>, nb::arg("image"), nb::arg("photo"),
             "Structural similarity, as scikit-image's with a Gaussian window of sigma 1.5.");
  bind_report(module);
  module.def(
      "evaluate", &evaluate_renders, nb::arg("render"), nb::arg("dataset"),
      nb::arg("split") = "test", nb::kw_only(), nb::arg("background") = std::array<float, 3>{},
      nb::arg("output") = nb::none(), nb::arg("max_views") = 0, nb::arg("align") = false,
      "Compares render(camera), an array (height, width, 3 or 4), with the photos of a split; "
      "`output`: a folder for pictures and metrics.json; `align`: also with cameras moved to where "
      "their pictures fit best.");
}

}  // namespace raysplats::python
