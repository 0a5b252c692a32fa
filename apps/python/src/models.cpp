// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <nanobind/stl/string.h>

#include "bindings.hpp"
#include "context.hpp"
#include "gaussians.hpp"

namespace raysplats::python {

void bind_models(nb::module_& module) {
  using Guard = nb::call_guard<nb::gil_scoped_release>;
  nb::class_<HeldModel>(
      module, "Model",
      "Gaussians on a device. Tracers follow its changes and refuse gradients of a "
      "state that is gone.")
      .def(
          "__init__",
          [](HeldModel* self, HeldContext& context, const Gaussians& gaussians) {
            new (self) HeldModel(*context, gaussians);
          },
          nb::arg("context"), nb::arg("gaussians"), nb::keep_alive<1, 2>())
      .def(
          "assign", [](HeldModel& self, const Gaussians& gaussians) { self->assign(gaussians); },
          nb::arg("gaussians"), Guard(),
          "Replaces all parameters; number and degree may be others.")
      .def(
          "assign_arrays",
          [](HeldModel& self, const FloatArray& means, const FloatArray& quaternions,
             const FloatArray& log_scales, const FloatArray& opacities, const FloatArray& sh) {
            const Gaussians gaussians = gaussians_of(means, quaternions, log_scales, opacities, sh);
            Model& model = *self;
            const nb::gil_scoped_release release;
            model.assign(gaussians);
          },
          nb::arg("means"), nb::arg("quaternions"), nb::arg("log_scales"), nb::arg("opacities"),
          nb::arg("sh"), "assign() of arrays, shaped as those of Gaussians.")
      .def(
          "download", [](HeldModel& self) { return self->download(); }, Guard(),
          "The parameters as they are.")
      .def_prop_ro("sh_degree", [](HeldModel& self) { return self->sh_degree(); })
      .def_prop_ro(
          "revision", [](HeldModel& self) { return self->revision(); },
          "Another number after every change.")
      .def("__len__", [](HeldModel& self) { return self->size(); })
      .def("__repr__", [](HeldModel& self) {
        return fmt::format("<raysplats.Model: {} Gaussians of SH degree {}>", self->size(),
                           self->sh_degree());
      });
}

}  // namespace raysplats::python
