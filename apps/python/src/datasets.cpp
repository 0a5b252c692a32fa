// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/set.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "bindings.hpp"
#include "images.hpp"
#include "names.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "tuples.hpp"

namespace raysplats::python {
namespace {

/// Left, top, right and bottom of boxes.
using Areas = std::vector<std::array<double, 4>>;

std::vector<PhotoArea> areas_of(const Areas& boxes) {
  std::vector<PhotoArea> out;
  for (const auto& [left, top, right, bottom] : boxes) out.push_back({left, top, right, bottom});
  return out;
}

Areas boxes_of(const std::vector<PhotoArea>& areas) {
  Areas out;
  for (const auto& [left, top, right, bottom] : areas) out.push_back({left, top, right, bottom});
  return out;
}

/// The arguments of Dataset.load() in their order, as DatasetOptions.
using OptionsState = std::tuple<double,
                                int,
                                std::optional<std::set<std::string>>,
                                bool,
                                std::string,
                                std::string,
                                std::string,
                                Areas,
                                std::optional<std::array<double, 3>>>;

DatasetOptions options_of(const OptionsState& state) {
  const auto& [downscale, test_every, test_list, undistort, masks, alpha, borders, areas, origin] =
      state;
  DatasetOptions options;
  options.downscale = downscale;
  options.test_every = test_every;
  options.test_list = test_list;
  options.undistort = undistort;
  options.masks = value_of(kMaskUses, "masks", masks);
  options.alpha = value_of(kAlphaUses, "alpha", alpha);
  options.borders = value_of(kBorderUses, "borders", borders);
  options.ignore_areas = areas_of(areas);
  options.origin = origin;
  return options;
}

std::optional<OptionsState> options_state(const Dataset& dataset) {
  if (!dataset.read_as) return std::nullopt;
  const DatasetOptions& o = *dataset.read_as;
  return OptionsState(o.downscale, o.test_every, o.test_list, o.undistort,
                      name_of(kMaskUses, o.masks), name_of(kAlphaUses, o.alpha),
                      name_of(kBorderUses, o.borders), boxes_of(o.ignore_areas), o.origin);
}

/// A file of names, or the names themselves.
using TestList = std::optional<std::variant<std::filesystem::path, std::vector<std::string>>>;

std::optional<std::set<std::string>> names_of(const TestList& list) {
  if (!list) return std::nullopt;
  if (const auto* file = std::get_if<std::filesystem::path>(&*list)) return read_test_list(*file);
  const auto& names = std::get<std::vector<std::string>>(*list);
  return std::set<std::string>(names.begin(), names.end());
}

Dataset load(const std::filesystem::path& path,
             double downscale,
             int test_every,
             const TestList& test_list,
             bool undistort,
             const std::string& masks,
             const std::string& alpha,
             const std::string& borders,
             const Areas& ignore_areas,
             const std::optional<std::array<double, 3>>& origin) {
  return load_dataset(path, options_of({downscale, test_every, names_of(test_list), undistort,
                                        masks, alpha, borders, ignore_areas, origin}));
}

FloatView picture(const View& self) {
  Image image;
  {
    const nb::gil_scoped_release release;
    image = load_view_image(self);
  }
  return array_of(std::move(image));
}

/// Python knows no empty path: pathlib makes "." of it.
std::optional<std::filesystem::path> path_or_none(const std::filesystem::path& path) {
  return path.empty() ? std::nullopt : std::optional(path);
}

using Paths = std::array<std::optional<std::filesystem::path>, 3>;
using Border = std::optional<std::array<std::vector<int>, 4>>;
using ViewState =
    std::tuple<Camera, Camera, Paths, IndexArray, bool, bool, int, Border, Areas, bool>;
using DatasetState = std::tuple<std::string,
                                std::filesystem::path,
                                std::vector<View>,
                                FloatArray,
                                FloatArray,
                                IndexArray,
                                FloatArray,
                                bool,
                                std::array<double, 3>,
                                int,
                                std::optional<OptionsState>>;

Border border_state(const View& view) {
  if (!view.border) return std::nullopt;
  const PhotoBorder& border = *view.border;
  return std::array{border.top, border.bottom, border.left, border.right};
}

std::shared_ptr<const PhotoBorder> border_of(const Border& state, const Camera& photo) {
  if (!state) return nullptr;
  const auto& [top, bottom, left, right] = *state;
  const auto width = static_cast<std::size_t>(photo.width);
  const auto height = static_cast<std::size_t>(photo.height);
  if (top.size() != width || bottom.size() != width || left.size() != height ||
      right.size() != height) {
    throw UsageError("The border of this view is of another photo's size: copy views whole");
  }
  return std::make_shared<const PhotoBorder>(PhotoBorder{top, bottom, left, right});
}

View view_of(const ViewState& state) {
  const auto& [camera, source_camera, paths, points, mask_apart, mask_cuts, sample_bytes, border,
               ignored, test] = state;
  View out;
  out.camera = camera;
  out.source_camera = source_camera;
  out.image_path = paths[0].value_or("");
  out.mask_path = paths[1].value_or("");
  out.depth_path = paths[2].value_or("");
  out.points = numbers(points, "points", {kAny}).copy();
  out.mask_apart = mask_apart;
  out.mask_cuts = mask_cuts;
  out.sample_bytes = sample_bytes;
  out.border = border_of(border, source_camera);
  out.ignored = areas_of(ignored);
  out.test = test;
  return out;
}

Dataset dataset_of(const DatasetState& state) {
  const auto& [kind, root, views, positions, colors, tracks, errors, alpha_is_background, origin,
               test_every, read_as] = state;
  Dataset out;
  out.kind = value_of(kDatasetKinds, "kind", kind);
  out.root = root;
  out.views = views;
  out.points.positions = numbers(positions, "positions", {kAny, 3}).copy();
  out.points.colors = numbers(colors, "colors", {kAny, 3}).copy();
  out.points.track_lengths = numbers(tracks, "track_lengths", {kAny}).copy();
  out.points.errors = numbers(errors, "errors", {kAny}).copy();
  out.alpha_is_background = alpha_is_background;
  out.origin = origin;
  out.test_every = test_every;
  if (read_as) out.read_as = options_of(*read_as);
  return out;
}

void bind_view(nb::module_& module) {
  using Self = nb::handle_t<View>;
  nb::class_<View>(module, "View", "One photo and the camera that took it.")
      .def_ro("camera", &View::camera, "Of the picture that picture() gives.")
      .def_ro("image_path", &View::image_path)
      .def_prop_ro(
          "mask_path", [](const View& self) { return path_or_none(self.mask_path); },
          "None when there is none.")
      .def_ro("source_camera", &View::source_camera, "Of the photo on disk, with its lens.")
      .def_ro("test", &View::test)
      .def("picture", &picture,
           "(height, width, 4): the photo, undistorted and resampled; alpha is mask or coverage, "
           "colour is straight.")
      .def("__getstate__",
           [](Self self) {
             auto& v = nb::cast<View&>(self);
             return std::tuple(v.camera, v.source_camera,
                               Paths{path_or_none(v.image_path), path_or_none(v.mask_path),
                                     path_or_none(v.depth_path)},
                               view(self, v.points.data(), {v.points.size()}), v.mask_apart,
                               v.mask_cuts, v.sample_bytes, border_state(v), boxes_of(v.ignored),
                               v.test);
           })
      .def(
          "__setstate__",
          [](View& self, const ViewState& state) { new (&self) View(view_of(state)); },
          nb::arg("state"))
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
          nb::arg("test_every") = 8, nb::arg("test_list") = nb::none(), nb::arg("undistort") = true,
          nb::arg("masks") = "ignore", nb::arg("alpha") = "auto", nb::arg("borders") = "auto",
          nb::arg("ignore_areas") = Areas{}, nb::arg("origin") = nb::none(),
          nb::call_guard<nb::gil_scoped_release>(),
          "Reads a COLMAP, nerfstudio, Blender, LLFF or Polycam folder, everything but the pixels. "
          "test_list: names of the photos that are held out, or a file of them, in place of those "
          "that test_every and files of the data set say. ignore_areas: (left, top, right, bottom) "
          "of boxes that count of no photo, in shares of width and height from the top left.")
      .def_prop_ro(
          "kind", [](const Dataset& self) { return name_of(kDatasetKinds, self.kind); },
          "'colmap', 'blender', 'nerfstudio', 'llff' or 'polycam'.")
      .def_ro("root", &Dataset::root)
      .def_ro("test_every", &Dataset::test_every,
              "Every n-th view is held out; 0 where a list or files name those, or none is.")
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
      .def_prop_rw(
          "point_positions",
          [](Self self) {
            PointCloud& points = nb::cast<Dataset&>(self).points;
            return view(self, points.positions.data(), {points.size(), 3});
          },
          set_view("point_positions"), "(N, 3), sparse points of the data set; a view.")
      .def_prop_rw(
          "point_colors",
          [](Self self) {
            PointCloud& points = nb::cast<Dataset&>(self).points;
            return view(self, points.colors.data(), {points.size(), 3});
          },
          set_view("point_colors"), "(N, 3), in [0, 1]; a view.")
      .def("__getstate__",
           [](Self self) {
             auto& d = nb::cast<Dataset&>(self);
             PointCloud& points = d.points;
             return std::tuple(
                 name_of(kDatasetKinds, d.kind), d.root, nb::object(self.attr("views")),
                 nb::object(self.attr("point_positions")), nb::object(self.attr("point_colors")),
                 view(self, points.track_lengths.data(), {points.track_lengths.size()}),
                 view(self, points.errors.data(), {points.errors.size()}), d.alpha_is_background,
                 d.origin, d.test_every, options_state(d));
           })
      .def(
          "__setstate__",
          [](Dataset& self, const DatasetState& state) { new (&self) Dataset(dataset_of(state)); },
          nb::arg("state"))
      .def("__len__", [](const Dataset& self) { return self.views.size(); });
}

}  // namespace raysplats::python
