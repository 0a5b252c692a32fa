// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <tuple>

#include "bindings.hpp"
#include "names.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/io.hpp"
#include "tuples.hpp"

namespace raysplats::python {
namespace {

namespace nb = nanobind;

using Vector = std::array<double, 3>;
using Matrix = std::array<Vector, 3>;  // rows
using Lens = std::array<double, 6>;

glm::dvec3 to_glm(const Vector& v) { return {v[0], v[1], v[2]}; }
Vector from_glm(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

void set_rotation(Camera& camera, const Matrix& rows) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      camera.rotation[column][row] =
          rows[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
    }
  }
}

Matrix rotation(const Camera& camera) {
  Matrix rows{};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      rows[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] =
          camera.rotation[column][row];
    }
  }
  return rows;
}

Lens lens(const Camera& camera) {
  const Distortion& d = camera.distortion;
  return {d.k1, d.k2, d.k3, d.p1, d.p2, d.k4};
}

void set_lens(Camera& camera, const Lens& lens) {
  camera.distortion = {lens[0], lens[1], lens[2], lens[3], lens[4], lens[5]};
}

Camera make_camera(int width,
                   int height,
                   double fx,
                   std::optional<double> fy,
                   std::optional<double> cx,
                   std::optional<double> cy,
                   const Matrix& rotation,
                   const Vector& translation,
                   const std::string& model,
                   const Lens& distortion,
                   const std::string& name) {
  Camera camera;
  camera.name = name;
  camera.width = width;
  camera.height = height;
  camera.fx = fx;
  camera.fy = fy.value_or(fx);
  camera.cx = cx.value_or(0.5 * width);
  camera.cy = cy.value_or(0.5 * height);
  set_rotation(camera, rotation);
  camera.translation = to_glm(translation);
  camera.model = value_of(kCameraModels, "model", model);
  set_lens(camera, distortion);
  return camera;
}

using PhotoLensState = std::tuple<std::string,
                                  Lens,
                                  std::array<double, 3>,
                                  double,
                                  double,
                                  std::array<double, 4>,
                                  bool,
                                  double,
                                  double>;
using CameraState = std::tuple<std::string,
                               int,
                               int,
                               std::array<double, 4>,
                               Matrix,
                               Vector,
                               std::string,
                               Lens,
                               std::optional<PhotoLensState>>;

PhotoLensState state_of(const PhotoLens& l) {
  return {name_of(kPhotoLensForms, l.form),
          l.radial,
          l.divisor,
          l.p1,
          l.p2,
          l.prism,
          l.decentred_last,
          l.radius,
          l.limit};
}

CameraState state_of(const Camera& c) {
  std::optional<PhotoLensState> photo_lens;
  if (c.lens) photo_lens = state_of(*c.lens);
  return {c.name,
          c.width,
          c.height,
          {c.fx, c.fy, c.cx, c.cy},
          rotation(c),
          from_glm(c.translation),
          name_of(kCameraModels, c.model),
          lens(c),
          photo_lens};
}

Camera camera_of(const CameraState& state) {
  const auto& [name, width, height, focal, rotation, translation, model, distortion, photo_lens] =
      state;
  Camera camera = make_camera(width, height, focal[0], focal[1], focal[2], focal[3], rotation,
                              translation, model, distortion, name);
  if (photo_lens) {
    const auto& [form, radial, divisor, p1, p2, prism, decentred_last, radius, limit] = *photo_lens;
    camera.lens = std::make_shared<const PhotoLens>(
        PhotoLens{value_of(kPhotoLensForms, "the form of a lens", form), radial, divisor, p1, p2,
                  prism, decentred_last, radius, limit});
  }
  return camera;
}

constexpr Matrix kIdentity{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

void bind_class(nb::module_& module) {
  nb::class_<Camera>(
      module, "Camera",
      "A camera with a pose. Axes are OpenCV's: x right, y down, z forward; the pixel "
      "(column i, row j) has its centre at (i + 0.5, j + 0.5). Rotation and "
      "translation take the world to the camera.")
      .def(
          "__init__",
          [](Camera* self, int width, int height, double fx, std::optional<double> fy,
             std::optional<double> cx, std::optional<double> cy, const Matrix& rotation,
             const Vector& translation, const std::string& model, const Lens& distortion,
             const std::string& name) {
            new (self) Camera(make_camera(width, height, fx, fy, cx, cy, rotation, translation,
                                          model, distortion, name));
          },
          nb::arg("width"), nb::arg("height"), nb::arg("fx"), nb::arg("fy") = nb::none(),
          nb::arg("cx") = nb::none(), nb::arg("cy") = nb::none(), nb::kw_only(),
          nb::arg("rotation") = kIdentity, nb::arg("translation") = Vector{},
          nb::arg("model") = "pinhole", nb::arg("distortion") = Lens{}, nb::arg("name") = "",
          "Pixels; fy is fx and the principal point the middle unless given.")
      .def_static(
          "look_at",
          [](const Vector& eye, const Vector& target, const Vector& up, int width, int height,
             double focal) {
            return look_at(to_glm(eye), to_glm(target), to_glm(up), width, height, focal);
          },
          nb::arg("eye"), nb::arg("target"), nb::arg("up"), nb::arg("width"), nb::arg("height"),
          nb::arg("focal"), "A pinhole camera; `up` points up in the picture.")
      .def_rw("name", &Camera::name)
      .def_rw("width", &Camera::width)
      .def_rw("height", &Camera::height)
      .def_rw("fx", &Camera::fx)
      .def_rw("fy", &Camera::fy)
      .def_rw("cx", &Camera::cx)
      .def_rw("cy", &Camera::cy)
      .def_prop_rw("rotation", &rotation, &set_rotation, "World to camera, rows.")
      .def_prop_rw(
          "translation", [](const Camera& c) { return from_glm(c.translation); },
          [](Camera& c, const Vector& v) { c.translation = to_glm(v); },
          "World to camera: x_camera = rotation x + translation.")
      .def_prop_ro(
          "center", [](const Camera& c) { return from_glm(c.center()); }, "In the world.")
      .def_prop_rw(
          "model", [](const Camera& c) { return name_of(kCameraModels, c.model); },
          [](Camera& c, const std::string& name) {
            c.model = value_of(kCameraModels, "model", name);
          },
          "'pinhole', 'opencv', 'fisheye', 'equirectangular' or 'orthographic'; of photos on disk "
          "also 'photo-lens', which nothing is rendered through.")
      .def_prop_rw("distortion", &lens, &set_lens, "k1, k2, k3, p1, p2, k4 of OpenCV's models.")
      .def(
          "downscaled", [](const Camera& c, double factor) { return downscaled(c, factor); },
          nb::arg("factor"), "The camera of the same view for a picture reduced by `factor`.")
      .def("__getstate__", [](const Camera& c) { return state_of(c); })
      .def(
          "__setstate__",
          [](Camera& self, const CameraState& state) { new (&self) Camera(camera_of(state)); },
          nb::arg("state"))
      .def("__repr__", [](const Camera& c) {
        return fmt::format("<raysplats.Camera {}: {}x{}, fx {:.6g}>",
                           name_of(kCameraModels, c.model), c.width, c.height, c.fx);
      });
}

}  // namespace

void bind_cameras(nb::module_& module) {
  bind_class(module);
  module.def("read_cameras", &read_cameras, nb::arg("path"),
             "Cameras of a transforms.json (Blender or nerfstudio) or of a cameras.json (3DGS).");
  module.def("write_cameras", &write_cameras, nb::arg("path"), nb::arg("cameras"),
             "Writes a transforms.json that read_cameras() reads back.");
}

}  // namespace raysplats::python
