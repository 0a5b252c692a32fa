// SPDX-License-Identifier: Apache-2.0
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "bindings.hpp"
#include "keywords.hpp"
#include "names.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trace_options.hpp"
#include "tuples.hpp"

namespace raysplats::python {
namespace {

namespace nb = nanobind;

void bind_choices(nb::class_<TraceOptions>& type) {
  type.def_prop_rw(
          "hit_order", [](const TraceOptions& o) { return name_of(kHitOrders, o.hit_order); },
          [](TraceOptions& o, const std::string& name) {
            o.hit_order = value_of(kHitOrders, "hit_order", name);
          },
          "'entry' (near root, the paper) or 'peak' (depth of the strongest response).")
      .def_prop_rw(
          "traversal", [](const TraceOptions& o) { return name_of(kTraversals, o.traversal); },
          [](TraceOptions& o, const std::string& name) {
            o.traversal = value_of(kTraversals, "traversal", name);
          },
          "'auto', 'tiles' or 'bvh'.")
      .def_prop_rw(
          "packet_shape",
          [](const TraceOptions& o) { return name_of(kPacketShapes, o.packet_shape); },
          [](TraceOptions& o, const std::string& name) {
            o.packet_shape = value_of(kPacketShapes, "packet_shape", name);
          },
          "'auto', 'vector', 'group' or 'subgroup'.")
      .def_prop_rw(
          "gradient_sum",
          [](const TraceOptions& o) { return name_of(kGradientSums, o.gradient_sum); },
          [](TraceOptions& o, const std::string& name) {
            o.gradient_sum = value_of(kGradientSums, "gradient_sum", name);
          },
          "'auto', 'copies', 'exact', 'atomic' or 'swap'.");
}

}  // namespace

void bind_trace_options(nb::module_& module) {
  nb::class_<TraceOptions> type(
      module, "TraceOptions",
      "How rays are traced (docs/model.md); the defaults are the paper's. A model file says how it "
      "was trained: TraceOptions.load(path).");
  def_keywords(type, "TraceOptions");
  type.def_static(
          "load", [](const std::filesystem::path& path) { return read_ply_options(path); },
          nb::arg("path"), "The options in the header of a PLY that raysplats wrote, else None.")
      .def_static("peak_order", &peak_order,
                  "What models of other programs are shown by: the order of hits of rasterisers, "
                  "ellipsoids no larger than what they show, and nothing thinner than pixels.")
      .def_rw("quantile", &TraceOptions::quantile,
              "A ray meets a Gaussian when the squared whitened distance is at most this.")
      .def_rw("min_transmittance", &TraceOptions::min_transmittance, "A ray stops below this.")
      .def_rw("max_hits", &TraceOptions::max_hits, "A ray stops after this many hits.")
      .def_rw("adaptive_radius", &TraceOptions::adaptive_radius,
              "The quantile shrinks where opacity times response would be below 1/255.")
      .def_rw("near_depth", &TraceOptions::near_depth,
              "Gaussians nearer along the viewing axis are skipped; 0 = off.")
      .def_rw("view_footprint", &TraceOptions::view_footprint,
              "Pictures show nothing thinner than this share of a pixel, and what is thinner "
              "fainter, but in differentiable ones whose rays are traced one by one; 0 = off.")
      .def_rw("background", &TraceOptions::background, "Colour behind everything.")
      .def_prop_rw(
          "sky", [](const TraceOptions& o) { return tuple_of(o.sky); },
          [](TraceOptions& o, const SkyLight& sky) { o.sky = sky; },
          "Behind everything in pictures, in place of `background`: 1, 4, 9, 16 or 25 (r, g, b) "
          "of spherical harmonics, world axes, plus 0.5; () = none.")
      .def_rw("depth", &TraceOptions::depth, "Pictures have depths and numbers of hits too.")
      .def_rw("packet_width", &TraceOptions::packet_width,
              "Rays of a packet; 0 = the device's own.")
      .def_rw("deterministic", &TraceOptions::deterministic, "The same bits every time.")
      .def_rw("raise_clamped", &TraceOptions::raise_clamped,
              "Where a colour is clamped at 0, gradients that would raise it pass all the same: "
              "what `raysplats train` does.")
      .def_rw("least_weight", &TraceOptions::least_weight,
              "What a ray blends of a Gaussian that training takes for nothing (prune_weight of "
              "TrainOptions).")
      .def_rw("launch_budget_ms", &TraceOptions::launch_budget_ms,
              "Time of one launch; 0 = unbounded, -1 = the device's default.")
      .def_rw("memory_budget", &TraceOptions::memory_budget,
              "Bytes for hit lists and private gradients; 0 = the device's default.");
  bind_choices(type);
}

}  // namespace raysplats::python
