// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>

/// What every file of the module adds to it.
namespace raysplats::python {

void bind_errors(nanobind::module_& module);
void bind_images(nanobind::module_& module);
void bind_devices(nanobind::module_& module);
void bind_gaussians(nanobind::module_& module);
void bind_cameras(nanobind::module_& module);
void bind_trace_options(nanobind::module_& module);
void bind_models(nanobind::module_& module);
void bind_tracer(nanobind::module_& module);
void bind_datasets(nanobind::module_& module);
void bind_metrics(nanobind::module_& module);
void bind_trainer(nanobind::module_& module);
void bind_scenes(nanobind::module_& module);
void bind_path_tracer(nanobind::module_& module);
void bind_viewer(nanobind::module_& module);

}  // namespace raysplats::python
