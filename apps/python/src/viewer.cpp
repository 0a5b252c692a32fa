// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "bindings.hpp"
#include "context.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/error.hpp"
#include "raysplats/trace_options.hpp"
#include "scene/camera/camera_check.hpp"
#include "signals.hpp"
#include "tuples.hpp"
#include "view/model_viewer.hpp"

namespace raysplats::python {
namespace {

namespace nb = nanobind;

using HeldViewer = Held<view::ModelViewer>;

void make(HeldViewer* self,
          HeldContext& context,
          HeldModel& model,
          const TraceOptions& options,
          const std::vector<Camera>& cameras,
          const std::string& name,
          const std::string& host,
          std::uint16_t port,
          int max_size,
          const std::array<double, 3>& origin) {
  view::ViewerOptions viewer;
  viewer.server.host = host;
  viewer.server.port = port;
  if (max_size < view::kLeastMaxSide || max_size > view::kMostMaxSide) {
    throw UsageError(fmt::format("max_size is {} to {}, not {}", view::kLeastMaxSide,
                                 view::kMostMaxSide, max_size));
  }
  viewer.max_side = max_size;
  for (const Camera& each : cameras) require_pixels(each);
  new (self) HeldViewer(*context, *model, options, cameras, name, viewer, origin);
}

// Until it is closed, or a signal says otherwise.
void wait(HeldViewer& self) {
  const view::ModelViewer& viewer = *self;
  const nb::gil_scoped_release release;
  while (viewer.serves()) {
    heed_signals(0);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

}  // namespace

void bind_viewer(nb::module_& module) {
  using Guard = nb::call_guard<nb::gil_scoped_release>;
  nb::class_<HeldViewer>(module, "_ModelViewer", "What raysplats.Viewer is made of.")
      .def("__init__", &make, nb::arg("context"), nb::arg("model"), nb::arg("options"),
           nb::arg("cameras"), nb::arg("name"), nb::arg("host"), nb::arg("port"),
           nb::arg("max_size"), nb::arg("origin"), nb::keep_alive<1, 2>(), nb::keep_alive<1, 3>())
      .def_prop_ro("url", [](HeldViewer& self) { return self->url(); })
      .def("wait", &wait)
      .def(
          "close",
          [](HeldViewer& self) {
            if (!is_forked()) self->close();
          },
          Guard());
}

}  // namespace raysplats::python
