// SPDX-License-Identifier: Apache-2.0
// raysplats._raysplats: the public C++ interface (include/raysplats) for Python.
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "bindings.hpp"
#include "raysplats/error.hpp"

namespace nb = nanobind;

namespace {

void set_log_level(const std::string& level) {
  if (level == "quiet") return spdlog::set_level(spdlog::level::err);
  if (level == "normal") return spdlog::set_level(spdlog::level::warn);
  if (level == "verbose") return spdlog::set_level(spdlog::level::info);
  throw raysplats::UsageError("level is 'quiet', 'normal' or 'verbose', not '" + level + "'");
}

}  // namespace

NB_MODULE(_raysplats, module) {
  module.doc() = "Trains and renders 3D Gaussians by ray tracing on any OpenCL device.";
  module.attr("__version__") = RAYSPLATS_VERSION;
  // Standard output belongs to the program.
  spdlog::set_default_logger(spdlog::stderr_color_mt("raysplats"));
  spdlog::set_pattern("raysplats: %^%l%$: %v");
  set_log_level("normal");
  module.def(
      "set_log_level", &set_log_level, nb::arg("level"),
      "What goes to standard error: 'quiet' (errors), 'normal' (warnings too) or 'verbose'.");

  using namespace raysplats::python;
  bind_errors(module);
  bind_images(module);
  bind_devices(module);
  bind_gaussians(module);
  bind_cameras(module);
  bind_trace_options(module);
  bind_models(module);
  bind_scenes(module);
  bind_tracer(module);
  bind_datasets(module);
  bind_metrics(module);
  bind_trainer(module);
  bind_path_tracer(module);
  bind_viewer(module);
}
