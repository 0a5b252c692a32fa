// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <nanobind/stl/array.h>
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
#include "raysplats/dataset.hpp"

namespace raysplats::python {
namespace {

Dataset load(const std::filesystem::path& path,
             double downscale,
             int test_every,
             bool undistort,
             const std::string& masks,
             const std::string& alpha,
             const std::optional<std::array<double, 3>>& origin) {
  DatasetOptions options;
  options.downscale = downscale;
  options.test_every = test_every;
  options.undistort = undistort;
  options.masks = value_of(kMaskUses, "masks", masks);
  options.alpha = value_of(kAlphaUses, "alpha", alpha);
  options.origin = origin;
  return load_dataset(path, options);
}

FloatView picture(const View& self) {
  Image image;
  {
    const nb::gil_scoped_release release;
    image = load_view_image(self);
  }
  return array_of(std::move(image));
}

void bind_view(nb::module_& module) {
  nb::class_<View>(module, "View", "One photo and the camera that took it.")
      .def_ro("camera", &View::camera, "Of the picture that picture() gives.")
      .def_ro("image_path", &View::image_path)
      .def_ro("mask_path", &View::mask_path, "Empty when there is none.")
      .def_ro("source_camera", &View::source_camera, "Of the photo on disk, with its lens.")
      .def_ro("test", &View::test)
      .def("picture", &picture,
           "(height, width, 4): the photo, undistorted and resampled; alpha is mask or coverage, "
           "colour is straight.")
      .def("__repr__",
           [](const View& self) { return fmt::format("<raysplats.View {}>", self.camera.name); });
}

}  // namespace

void bind_datasets(nb::module_& module) {
  bind_view(module);
  using Self = nb::handle_t<Dataset>;
  nb::class_<Dataset>(module, "Dataset", "Photos, cameras and points of one scene.")
      .def_static(
          "load", &load, nb::arg("path"), nb::kw_only(), nb::arg("downscale") = 1.0,
          nb::arg("test_every") = 8, nb::arg("undistort") = true, nb::arg("masks") = "ignore",
          nb::arg("alpha") = "auto", nb::arg("origin") = nb::none(),
          nb::call_guard<nb::gil_scoped_release>(),
          "Reads a COLMAP, nerfstudio, Blender, LLFF or Polycam folder, everything but the pixels.")
      .def_prop_ro(
          "kind", [](const Dataset& self) { return name_of(kDatasetKinds, self.kind); },
          "'colmap', 'blender', 'nerfstudio', 'llff' or 'polycam'.")
      .def_ro("root", &Dataset::root)
      .def_ro("origin", &Dataset::origin,
              "What was taken off all positions of the files: 0, but near the cameras where the "
              "scene lies far away.")
      .def_ro("alpha_is_background", &Dataset::alpha_is_background,
              "Whether photos are blended over the background by their alpha; else it is a mask.")
      .def_prop_ro(
          "views",
          [](Self self) {
            nb::typed<nb::list, View> out;
            for (View& each : nb::cast<Dataset&>(self).views) {
              out.append(nb::cast(&each, nb::rv_policy::reference_internal, self));
            }
            return out;
          },
          "Sorted by name within a split.")
      .def(
          "indices",
          [](const Dataset& self, const std::string& split) {
            return self.indices(value_of(kSplits, "split", split));
          },
          nb::arg("split"), "Of the views of 'train', 'test' or 'all'.")
      .def_prop_ro(
          "point_positions",
          [](Self self) {
            PointCloud& points = nb::cast<Dataset&>(self).points;
            return view(self, points.positions.data(), {points.size(), 3});
          },
          "(N, 3), sparse points of the data set; a view.")
      .def_prop_ro(
          "point_colors",
          [](Self self) {
            PointCloud& points = nb::cast<Dataset&>(self).points;
            return view(self, points.colors.data(), {points.size(), 3});
          },
          "(N, 3), in [0, 1]; a view.")
      .def("__len__", [](const Dataset& self) { return self.views.size(); });
}

}  // namespace raysplats::python
