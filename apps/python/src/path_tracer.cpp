// SPDX-License-Identifier: Apache-2.0
#include "raysplats/path_tracer.hpp"

#include <nanobind/stl/vector.h>

#include <utility>
#include <vector>

#include "bindings.hpp"
#include "context.hpp"
#include "images.hpp"
#include "signals.hpp"

namespace raysplats::python {
namespace {

using HeldPathTracer = Held<PathTracer>;

FloatView render(HeldPathTracer& self, const Camera& camera) {
  PathTracer& tracer = *self;
  Image image;
  {
    const nb::gil_scoped_release release;
    image = tracer.render(camera, &heed_signals);
  }
  return array_of(std::move(image));
}

void bind_statistics(nb::module_& module) {
  using Statistics = PathTracer::Statistics;
  nb::class_<Statistics>(module, "PathStatistics", "Rays of the last picture.")
      .def_ro("camera_rays", &Statistics::camera_rays)
      .def_ro("continued_rays", &Statistics::continued_rays, "Behind surfaces.")
      .def_ro("shadow_rays", &Statistics::shadow_rays)
      .def_ro("capped_rays", &Statistics::capped_rays, "Stopped by TraceOptions.max_hits.")
      .def_ro("ended_by_bounces", &Statistics::ended_by_bounces, "Paths that max_bounces ended.");
}

}  // namespace

void bind_path_tracer(nb::module_& module) {
  bind_statistics(module);
  nb::class_<HeldPathTracer>(module, "PathTracer", "Draws a Scene by path tracing (docs/light.md).")
      .def(
          "__init__",
          [](HeldPathTracer* self, HeldContext& context, const Scene& scene) {
            new (self) HeldPathTracer(*context, scene);
          },
          nb::arg("context"), nb::arg("scene"), nb::keep_alive<1, 2>(),
          "Uploads the scene; later changes of it are not seen.")
      .def("render", &render, nb::arg("camera"),
           "(height, width, 4): background or environment blended in, alpha is the share of light "
           "that did not come from there.")
      .def(
          "set_meshes",
          [](HeldPathTracer& self, const std::vector<Mesh>& meshes) { self->set_meshes(meshes); },
          nb::arg("meshes"), nb::call_guard<nb::gil_scoped_release>(),
          "The same materials and Gaussians with other meshes.")
      .def_prop_ro(
          "statistics", [](HeldPathTracer& self) { return self->statistics(); },
          nb::call_guard<nb::gil_scoped_release>());
}

}  // namespace raysplats::python
