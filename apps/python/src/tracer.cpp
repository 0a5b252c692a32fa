// SPDX-License-Identifier: Apache-2.0
#include "raysplats/tracer.hpp"

#include <fmt/format.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "context.hpp"
#include "images.hpp"
#include "names.hpp"
#include "raysplats/contributions.hpp"
#include "raysplats/error.hpp"
#include "signals.hpp"
#include "tuples.hpp"

namespace raysplats::python {
namespace {

using HeldTracer = Held<Tracer>;

struct Picture {
  Image rgba;
  std::optional<Image> depth;
  std::uint64_t capped_rays = 0;
};

struct TracedRays {
  std::vector<RayResult> results;
};

std::size_t size(int length) { return static_cast<std::size_t>(length); }

/// Channels [first, first + count) of a picture; `count` 0: one channel without an axis of its own.
FloatView channels(nb::handle owner, Image& image, int first, int count) {
  const std::int64_t pixel = image.channels;
  const std::int64_t row = pixel * image.width;
  float* data = image.data.data() + first;
  if (count == 0) return view(owner, data, {size(image.height), size(image.width)}, {row, pixel});
  return view(owner, data, {size(image.height), size(image.width), size(count)}, {row, pixel, 1});
}

/// A channel of the depth picture, when there is one.
std::optional<FloatView> depth_channel(nb::handle self, int channel) {
  auto& picture = nb::cast<Picture&>(self);
  if (!picture.depth) return std::nullopt;
  return channels(self, *picture.depth, channel, 0);
}

Picture render(HeldTracer& self, HeldModel& model, const Camera& camera, bool differentiable) {
  Tracer& tracer = *self;
  const Model& gaussians = *model;
  const nb::gil_scoped_release release;
  const auto lock = gaussians.context().lock();
  Picture out;
  out.rgba = tracer.render(gaussians, camera, differentiable, &heed_signals);
  if (tracer.options().depth) out.depth = tracer.depth();
  out.capped_rays = tracer.capped_rays();
  return out;
}

ViewGradients backward(HeldTracer& self, HeldModel& model, const FloatArray& gradient) {
  const Numbers<float> given = numbers(gradient, "gradient", {kAny, kAny, 4});
  constexpr auto kLongest = static_cast<std::size_t>(std::numeric_limits<int>::max());
  if (given.shape[0] > kLongest || given.shape[1] > kLongest) {
    throw UsageError("gradient is larger than any picture");
  }
  Image image;
  image.height = static_cast<int>(given.shape[0]);
  image.width = static_cast<int>(given.shape[1]);
  image.channels = 4;
  image.data = given.copy();
  Tracer& tracer = *self;
  const Model& gaussians = *model;
  const nb::gil_scoped_release release;
  return tracer.backward(gaussians, image);
}

/// One number for all rays, or one for each. The second takes numbers of other types too, such as
/// numpy's and arrays without axes.
using Bounds = std::variant<float, FloatArray>;

std::vector<float> bounds_of(const Bounds& given, const char* name, std::size_t count) {
  if (const auto* all = std::get_if<float>(&given)) return std::vector<float>(count, *all);
  const FloatArray& each = std::get<FloatArray>(given);
  const nb::object axes = nb::getattr(each.value, "ndim", nb::int_(0));
  if (PyNumber_Check(each.value.ptr()) != 0 && axes.equal(nb::int_(0))) {
    return std::vector<float>(count, static_cast<float>(nb::cast<double>(nb::float_(each.value))));
  }
  return numbers(each, name, {static_cast<std::ptrdiff_t>(count)}).copy();
}

std::vector<Ray> rays_of(const FloatArray& origins,
                         const FloatArray& directions,
                         const Bounds& t_min,
                         const Bounds& t_max) {
  const Numbers<float> o = numbers(origins, "origins", {kAny, 3});
  const auto count = static_cast<std::ptrdiff_t>(o.shape[0]);
  const Numbers<float> d = numbers(directions, "directions", {count, 3});
  const std::vector<float> begin = bounds_of(t_min, "t_min", o.shape[0]);
  const std::vector<float> end = bounds_of(t_max, "t_max", o.shape[0]);
  std::vector<Ray> rays(o.shape[0]);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      rays[i].origin[k] = o.values[3 * i + k];
      rays[i].direction[k] = d.values[3 * i + k];
    }
    rays[i].t_min = begin[i];
    rays[i].t_max = end[i];
  }
  return rays;
}

TracedRays trace(HeldTracer& self,
                 HeldModel& model,
                 const FloatArray& origins,
                 const FloatArray& directions,
                 const Bounds& t_min,
                 const Bounds& t_max,
                 const std::string& color_direction,
                 bool differentiable) {
  const std::vector<Ray> rays = rays_of(origins, directions, t_min, t_max);
  const ColorDirection direction = value_of(kColorDirections, "color_direction", color_direction);
  Tracer& tracer = *self;
  const Model& gaussians = *model;
  const nb::gil_scoped_release release;
  return {tracer.trace(gaussians, rays, direction, differentiable, &heed_signals)};
}

FloatView normals(HeldTracer& self, HeldModel& model, const Camera& camera) {
  Tracer& tracer = *self;
  const Model& gaussians = *model;
  Image out;
  {
    const nb::gil_scoped_release release;
    out = tracer.normals(gaussians, camera, &heed_signals);
  }
  return array_of(std::move(out));
}

RaysGradients backward_rays(HeldTracer& self,
                            HeldModel& model,
                            const FloatArray& color,
                            const std::optional<FloatArray>& alpha) {
  const Numbers<float> c = numbers(color, "color", {kAny, 3});
  std::vector<RayResultGradient> gradients(c.shape[0]);
  for (std::size_t i = 0; i < gradients.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) gradients[i].color[k] = c.values[3 * i + k];
    gradients[i].alpha = 0.0f;
  }
  if (alpha) {
    const auto count = static_cast<std::ptrdiff_t>(gradients.size());
    const Numbers<float> a = numbers(*alpha, "alpha", {count});
    for (std::size_t i = 0; i < gradients.size(); ++i) gradients[i].alpha = a.values[i];
  }
  Tracer& tracer = *self;
  const Model& gaussians = *model;
  const nb::gil_scoped_release release;
  return tracer.backward(gaussians, gradients, &heed_signals);
}

/// A member of every record, as a strided view; `width` 0: a number each.
template <class T, class Record>
nb::ndarray<nb::numpy, T> column(nb::handle owner,
                                 std::vector<Record>& records,
                                 T* first,
                                 std::size_t width) {
  constexpr std::int64_t kStride = sizeof(Record) / sizeof(T);
  T* data = records.empty() ? nullptr : first;
  if (width == 0) return view(owner, data, {records.size()}, {kStride});
  return view(owner, data, {records.size(), width}, {kStride, 1});
}

void bind_picture(nb::module_& module) {
  using Self = nb::handle_t<Picture>;
  const auto image = [](nb::handle self) -> Image& { return nb::cast<Picture&>(self).rgba; };
  nb::class_<Picture>(module, "Picture", "What a camera sees. The arrays are views.")
      .def_prop_rw(
          "rgba", [image](Self self) { return channels(self, image(self), 0, 4); },
          set_view("rgba"),
          "(height, width, 4): colour with the background blended in, alpha = 1 - transmittance.")
      .def_prop_rw(
          "color", [image](Self self) { return channels(self, image(self), 0, 3); },
          set_view("color"), "(height, width, 3).")
      .def_prop_rw(
          "alpha", [image](Self self) { return channels(self, image(self), 3, 0); },
          set_view("alpha"), "(height, width).")
      .def_prop_rw(
          "expected_depth", [](Self self) { return depth_channel(self, 0); },
          set_view("expected_depth"),
          "(height, width), with TraceOptions.depth; 0 where nothing is.")
      .def_prop_rw(
          "median_depth", [](Self self) { return depth_channel(self, 1); },
          set_view("median_depth"), "(height, width), with TraceOptions.depth; 0 where nothing is.")
      .def_prop_rw(
          "hits", [](Self self) { return depth_channel(self, 2); }, set_view("hits"),
          "(height, width), blended Gaussians, with TraceOptions.depth.")
      .def_ro("capped_rays", &Picture::capped_rays, "Rays that TraceOptions.max_hits stopped.");
}

void bind_rays(nb::module_& module) {
  using Self = nb::handle_t<TracedRays>;
  const auto all = [](nb::handle self) -> std::vector<RayResult>& {
    return nb::cast<TracedRays&>(self).results;
  };
  nb::class_<TracedRays>(module, "TracedRays", "What N rays met. The arrays are views.")
      .def_prop_rw(
          "color",
          [all](Self self) { return column<float>(self, all(self), all(self).data()->color, 3); },
          set_view("color"), "(N, 3), background blended in.")
      .def_prop_rw(
          "alpha",
          [all](Self self) { return column<float>(self, all(self), &all(self).data()->alpha, 0); },
          set_view("alpha"), "(N,), 1 - transmittance.")
      .def_prop_rw(
          "expected_depth",
          [all](Self self) {
            return column<float>(self, all(self), &all(self).data()->expected_depth, 0);
          },
          set_view("expected_depth"), "(N,), mean depth of the hits in lengths of the direction.")
      .def_prop_rw(
          "median_depth",
          [all](Self self) {
            return column<float>(self, all(self), &all(self).data()->median_depth, 0);
          },
          set_view("median_depth"), "(N,), where less than half of the light is left; 0 = nowhere.")
      .def_prop_rw(
          "hits",
          [all](Self self) {
            return column<std::uint32_t>(self, all(self), &all(self).data()->hits, 0);
          },
          set_view("hits"), "(N,), blended Gaussians.")
      .def_prop_rw(
          "capped",
          [all](Self self) {
            return column<std::uint32_t>(self, all(self), &all(self).data()->capped, 0);
          },
          set_view("capped"), "(N,), 1 where TraceOptions.max_hits stopped the ray.")
      .def("__len__", [](const TracedRays& self) { return self.results.size(); });
}

void bind_gradients(nb::module_& module) {
  using View = nb::handle_t<ViewGradients>;
  nb::class_<ViewGradients>(module, "ViewGradients", "Gradients of a loss over a picture.")
      .def_ro("parameters", &ViewGradients::parameters,
              "Of the Gaussians, shaped as they are and before activation.")
      .def_prop_rw(
          "camera_center",
          [](View self) {
            return view(self, nb::cast<ViewGradients&>(self).pose.center.data(), {3});
          },
          set_view("camera_center"),
          "(3,), for moving the camera's centre along the axes of the world.")
      .def_prop_rw(
          "camera_rotation",
          [](View self) {
            return view(self, nb::cast<ViewGradients&>(self).pose.rotation.data(), {3});
          },
          set_view("camera_rotation"),
          "(3,), for a small turn w about the centre in camera axes and radians: rotation := "
          "exp([w]x) rotation, the centre stays; NaN with mirrors and with a sky.")
      .def_ro("sky", &ViewGradients::sky, "Of TraceOptions.sky; [] without one.");
  using Rays = nb::handle_t<RaysGradients>;
  const auto by_ray = [](nb::handle self) -> std::vector<RayGradient>& {
    return nb::cast<RaysGradients&>(self).rays;
  };
  nb::class_<RaysGradients>(module, "RaysGradients", "Gradients of a loss over rays.")
      .def_ro("parameters", &RaysGradients::parameters, "As in ViewGradients.")
      .def_prop_rw(
          "origins",
          [by_ray](Rays self) {
            return column<float>(self, by_ray(self), by_ray(self).data()->origin, 3);
          },
          set_view("origins"), "(N, 3).")
      .def_prop_rw(
          "directions",
          [by_ray](Rays self) {
            return column<float>(self, by_ray(self), by_ray(self).data()->direction, 3);
          },
          set_view("directions"), "(N, 3), for directions as they were given, of any length.");
}

}  // namespace

void bind_tracer(nb::module_& module) {
  bind_picture(module);
  bind_rays(module);
  bind_gradients(module);
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  nb::class_<HeldTracer>(module, "Tracer",
                         "Traces Gaussians, forward and backward: pictures of cameras and rays of "
                         "your own. It remembers its last picture and its last rays.")
      .def(
          "__init__",
          [](HeldTracer* self, HeldContext& context, const std::optional<TraceOptions>& options,
             const std::optional<Mirrors>& mirrors) {
            new (self)
                HeldTracer(*context, options.value_or(TraceOptions{}), mirrors.value_or(Mirrors{}));
          },
          nb::arg("context"), nb::arg("options") = nb::none(), nb::kw_only(),
          nb::arg("mirrors") = nb::none(), nb::keep_alive<1, 2>())
      .def("render", &render, nb::arg("model"), nb::arg("camera"),
           nb::arg("differentiable") = false,
           "The picture at the camera's size; differentiable keeps what backward() needs.")
      .def("backward", &backward, nb::arg("model"), nb::arg("gradient"),
           "Gradients of the last picture from dL/d(R, G, B, A), shaped as Picture.rgba.")
      .def("normals", &normals, nb::arg("model"), nb::arg("camera"),
           "(height, width, 3): mean normal of what the camera sees times alpha, in world axes.")
      .def("trace", &trace, nb::arg("model"), nb::arg("origins"), nb::arg("directions"),
           nb::kw_only(), nb::arg("t_min") = 0.0f, nb::arg("t_max") = kInfinity,
           nb::arg("color_direction") = "ray", nb::arg("differentiable") = false,
           "N rays origin + t direction, arrays (N, 3), t in [t_min, t_max], numbers or (N,). "
           "Colours are those along the ray, or with 'from-origin' towards the mean.")
      .def("backward_rays", &backward_rays, nb::arg("model"), nb::arg("color"),
           nb::arg("alpha") = nb::none(),
           "Gradients of the last rays from dL/d(color), (N, 3), and dL/d(alpha), (N,).")
      .def(
          "set_background",
          [](HeldTracer& self, const std::array<float, 3>& color, const SkyLight& sky) {
            self->set_background(color, sky);
          },
          nb::arg("color"), nb::arg("sky") = SkyLight(), nb::call_guard<nb::gil_scoped_release>(),
          "Colour behind everything from the next call on, or TraceOptions.sky in its place.")
      .def_prop_ro(
          "options", [](HeldTracer& self) { return self->options(); },
          "A copy: a Tracer keeps those that it was made with, but for set_background().");
  module.def(
      "contributions",
      [](HeldContext& context, const Gaussians& gaussians, const std::vector<Camera>& cameras,
         const std::optional<TraceOptions>& options, const std::optional<Mirrors>& mirrors) {
        std::vector<double> found;
        {
          const nb::gil_scoped_release others;
          found = contributions(*context, gaussians, cameras, options.value_or(TraceOptions{}),
                                mirrors.value_or(Mirrors{}), &heed_signals);
        }
        const std::size_t count = found.size();
        return array_of(std::vector<float>(found.begin(), found.end()), {count});
      },
      nb::arg("context"), nb::arg("gaussians"), nb::arg("cameras"), nb::arg("options") = nb::none(),
      nb::kw_only(), nb::arg("mirrors") = nb::none(),
      "(N,): what each Gaussian gives to pictures of these views, the mean over their pixels of "
      "its share of the light. For Gaussians.changed(max_gaussians=..., contributions=...).");
}

}  // namespace raysplats::python
