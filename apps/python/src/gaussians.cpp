// SPDX-License-Identifier: Apache-2.0
#include "gaussians.hpp"

#include <fmt/format.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <optional>
#include <tuple>

#include "bindings.hpp"
#include "names.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "raysplats/model_changes.hpp"
#include "tuples.hpp"

namespace raysplats::python {
namespace {

using Self = nb::handle_t<Gaussians>;

Gaussians& held(nb::handle self) { return nb::cast<Gaussians&>(self); }

int degree_of(std::size_t coefficients) {
  constexpr int kMaxDegree = 4;
  for (int degree = 0; degree <= kMaxDegree; ++degree) {
    if (static_cast<std::size_t>(sh_coefficients(degree)) == coefficients) return degree;
  }
  throw UsageError(fmt::format(
      "sh has {} coefficients per Gaussian, but 1, 4, 9, 16 or 25 are needed", coefficients));
}

void require_rows(const Numbers<float>& array, const char* name, std::size_t count) {
  if (array.shape[0] == count) return;
  throw UsageError(
      fmt::format("{} has {} rows, but there are {} means", name, array.shape[0], count));
}

Gaussians zeros(std::int64_t count, int sh_degree) {
  constexpr int kMaxDegree = 4;
  if (count < 0) throw UsageError(fmt::format("count is at least 0, not {}", count));
  if (sh_degree < 0 || sh_degree > kMaxDegree) {
    throw UsageError(fmt::format("sh_degree is 0 to {}, not {}", kMaxDegree, sh_degree));
  }
  Gaussians out;
  out.sh_degree = sh_degree;
  out.resize(static_cast<std::size_t>(count));
  return out;
}

void bind_views(nb::class_<Gaussians>& type) {
  type.def_prop_rw(
          "means",
          [](Self self) {
            Gaussians& g = held(self);
            return view(self, g.means.data(), {g.size(), 3});
          },
          set_view("means"), "(N, 3), world units; a view.")
      .def_prop_rw(
          "quaternions",
          [](Self self) {
            Gaussians& g = held(self);
            return view(self, g.quaternions.data(), {g.size(), 4});
          },
          set_view("quaternions"), "(N, 4), real part first, normalised when used; a view.")
      .def_prop_rw(
          "log_scales",
          [](Self self) {
            Gaussians& g = held(self);
            return view(self, g.log_scales.data(), {g.size(), 3});
          },
          set_view("log_scales"), "(N, 3), natural logarithms of the standard deviations; a view.")
      .def_prop_rw(
          "opacities",
          [](Self self) {
            Gaussians& g = held(self);
            return view(self, g.opacities.data(), {g.size()});
          },
          set_view("opacities"), "(N,), logits; a view.")
      .def_prop_rw(
          "sh",
          [](Self self) {
            Gaussians& g = held(self);
            return view(self, g.sh.data(),
                        {g.size(), static_cast<std::size_t>(sh_coefficients(g.sh_degree)), 3});
          },
          set_view("sh"),
          "(N, (sh_degree + 1)^2, 3), coefficients of spherical harmonics; a view.");
}

void bind_pickling(nb::class_<Gaussians>& type) {
  using Arrays = std::tuple<FloatArray, FloatArray, FloatArray, FloatArray, FloatArray>;
  type.def("__getstate__",
           [](Self self) {
             return Arrays{{self.attr("means")},
                           {self.attr("quaternions")},
                           {self.attr("log_scales")},
                           {self.attr("opacities")},
                           {self.attr("sh")}};
           })
      .def(
          "__setstate__",
          [](Gaussians& self, const Arrays& state) {
            new (&self) Gaussians(std::apply(&gaussians_of, state));
          },
          nb::arg("state"));
}

using Triple = std::array<double, 3>;

glm::dvec3 vector_of(const Triple& t) { return {t[0], t[1], t[2]}; }

Gaussians change(const Gaussians& self,
                 const std::optional<double>& min_opacity,
                 const std::optional<Triple>& up,
                 double scale,
                 const Triple& rotate,
                 const Triple& translate,
                 const std::optional<Triple>& crop_min,
                 const std::optional<Triple>& crop_max,
                 const std::optional<std::size_t>& max_gaussians,
                 const std::optional<int>& sh_degree,
                 const std::vector<double>& contributions) {
  ModelChanges changes;
  changes.min_opacity = min_opacity;
  if (up) changes.up = vector_of(*up);
  changes.scale = scale;
  changes.rotate_degrees = vector_of(rotate);
  changes.translate = vector_of(translate);
  if (crop_min || crop_max) changes.crop.emplace();
  if (crop_min) changes.crop->low = *crop_min;
  if (crop_max) changes.crop->high = *crop_max;
  changes.max_gaussians = max_gaussians;
  changes.sh_degree = sh_degree;
  changes.contributions = contributions;
  return changed(self, changes);
}

}  // namespace

Gaussians gaussians_of(const FloatArray& means,
                       const FloatArray& quaternions,
                       const FloatArray& log_scales,
                       const FloatArray& opacities,
                       const FloatArray& sh) {
  const Numbers<float> m = numbers(means, "means", {kAny, 3});
  const Numbers<float> q = numbers(quaternions, "quaternions", {kAny, 4});
  const Numbers<float> s = numbers(log_scales, "log_scales", {kAny, 3});
  const Numbers<float> o = numbers(opacities, "opacities", {kAny});
  const Numbers<float> c = numbers(sh, "sh", {kAny, kAny, 3});
  const std::size_t count = m.shape[0];
  require_rows(q, "quaternions", count);
  require_rows(s, "log_scales", count);
  require_rows(o, "opacities", count);
  require_rows(c, "sh", count);
  return {degree_of(c.shape[1]), m.copy(), q.copy(), s.copy(), o.copy(), c.copy()};
}

void bind_gaussians(nb::module_& module) {
  nb::class_<Gaussians> type(
      module, "Gaussians",
      "N Gaussians in the host's memory, parameters before activation as in a 3DGS PLY. The arrays "
      "are views: writing to them changes the Gaussians. Their number is fixed.");
  type.def(
          "__init__",
          [](Gaussians* self, const FloatArray& means, const FloatArray& quaternions,
             const FloatArray& log_scales, const FloatArray& opacities, const FloatArray& sh) {
            new (self) Gaussians(gaussians_of(means, quaternions, log_scales, opacities, sh));
          },
          nb::arg("means"), nb::arg("quaternions"), nb::arg("log_scales"), nb::arg("opacities"),
          nb::arg("sh"), "Copies the arrays; the shapes are those of the views.")
      .def_static("zeros", &zeros, nb::arg("count"), nb::arg("sh_degree") = 0,
                  "Gaussians to be filled in: zeros and unit quaternions.")
      .def_static(
          "load",
          [](const std::filesystem::path& path, const std::string& spz_axes) {
            return read_model(path, {value_of(kSpzAxes, "spz_axes", spz_axes)});
          },
          nb::arg("path"), nb::kw_only(), nb::arg("spz_axes") = "ply",
          nb::call_guard<nb::gil_scoped_release>(),
          "Reads a 3DGS PLY, compressed PLY, .splat, SPZ, SOG or glTF (docs/formats.md).")
      .def(
          "save",
          [](const Gaussians& self, const std::filesystem::path& path,
             const std::optional<TraceOptions>& options, const std::array<double, 3>& origin,
             const std::string& spz_axes, int spz_version) {
            const ModelEncoding encoding{value_of(kSpzAxes, "spz_axes", spz_axes), spz_version};
            write_model(path, self, encoding, options, origin);
          },
          nb::arg("path"), nb::arg("options") = nb::none(),
          nb::arg("origin") = std::array<double, 3>{}, nb::kw_only(), nb::arg("spz_axes") = "ply",
          nb::arg("spz_version") = ModelEncoding{}.spz_version,
          nb::call_guard<nb::gil_scoped_release>(),
          "Writes .ply, .compressed.ply, .splat, .spz, .sog or .glb. `options` and the `origin` "
          "from which positions count, as Dataset.origin, go into the header of a PLY.")
      .def_static("load_origin", &read_ply_origin, nb::arg("path"),
                  "From where the positions of a PLY count once it is loaded: the origin in its "
                  "header, or what was taken off positions in doubles; else 0.")
      .def("changed", &change, nb::kw_only(), nb::arg("min_opacity") = nb::none(),
           nb::arg("up") = nb::none(), nb::arg("scale") = 1.0, nb::arg("rotate") = Triple{},
           nb::arg("translate") = Triple{}, nb::arg("crop_min") = nb::none(),
           nb::arg("crop_max") = nb::none(), nb::arg("max_gaussians") = nb::none(),
           nb::arg("sh_degree") = nb::none(), nb::arg("contributions") = std::vector<double>(),
           nb::call_guard<nb::gil_scoped_release>(),
           "A copy with the changes of `raysplats convert`, in this order: fainter Gaussians than "
           "`min_opacity` (0 to 1) are left out, the direction `up` becomes -y, then come `scale`, "
           "`rotate` (degrees about x, then y, then z) and `translate`, harmonics included; the "
           "box from `crop_min` to `crop_max` cuts the result, `max_gaussians` keeps those of the "
           "greatest `contributions` (one number of each Gaussian, as by contributions(); without "
           "them the largest and most opaque), and `sh_degree` drops bands or adds zeros.")
      .def("with_sh_degree", &with_sh_degree, nb::arg("degree"),
           "A copy with bands added (zero) or dropped.")
      .def_ro("sh_degree", &Gaussians::sh_degree)
      .def("__len__", &Gaussians::size)
      .def("__repr__", [](const Gaussians& self) {
        return fmt::format("<raysplats.Gaussians: {} of SH degree {}>", self.size(),
                           self.sh_degree);
      });
  bind_views(type);
  bind_pickling(type);
}

}  // namespace raysplats::python
