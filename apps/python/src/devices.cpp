// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "bindings.hpp"
#include "context.hpp"
#include "names.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"

namespace raysplats::python {
namespace {

namespace nb = nanobind;

using Selector = std::variant<DeviceInfo, std::int64_t, std::string>;

DeviceInfo chosen(const Selector& selector) {
  if (const auto* info = std::get_if<DeviceInfo>(&selector)) return *info;
  if (const auto* index = std::get_if<std::int64_t>(&selector)) {
    return select_device(std::to_string(*index));
  }
  return select_device(std::get<std::string>(selector));
}

std::vector<DeviceInfo> devices() {
  require_own_process();
  const nb::gil_scoped_release release;
  return list_devices();
}

void make_context(
    HeldContext* self, const Selector& device, bool kernel_cache, bool tuning, bool profile) {
  require_own_process();
  ContextOptions options;
  options.kernel_cache = kernel_cache;
  options.tuning = tuning;
  options.profile = profile;
  new (self) HeldContext(chosen(device), options);
}

/// What `with context.lock()` holds. Used without the interpreter's lock: who has the context may
/// wait for that.
class Turn {
 public:
  explicit Turn(const Context& context) : context_(context) {}
  void begin() {
    auto lock = context_.lock();
    locks_.push_back(std::move(lock));
    holder_ = std::this_thread::get_id();
  }
  void end() {
    if (holder_ != std::this_thread::get_id()) {
      throw UsageError(
          "This thread does not have the lock of the Context: leave its with block in the thread "
          "that entered it");
    }
    const auto lock = std::move(locks_.back());
    locks_.pop_back();
    if (locks_.empty()) holder_ = std::thread::id();
  }

 private:
  const Context& context_;
  std::vector<std::unique_lock<std::recursive_mutex>> locks_;  // of the holder, who alone looks
  std::atomic<std::thread::id> holder_{};
};

std::string describe(const DeviceInfo& info) {
  return fmt::format("<raysplats.DeviceInfo {}: {} ({}), {}>", info.index, info.name,
                     name_of(kDeviceTypes, info.type), info.platform);
}

void bind_info(nb::module_& module) {
  nb::class_<DeviceInfo>(module, "DeviceInfo", "What one OpenCL device offers.")
      .def_ro("index", &DeviceInfo::index, "Position in devices().")
      .def_ro("name", &DeviceInfo::name)
      .def_ro("vendor", &DeviceInfo::vendor)
      .def_ro("platform", &DeviceInfo::platform)
      .def_ro("version", &DeviceInfo::version, "OpenCL version of the device.")
      .def_ro("driver_version", &DeviceInfo::driver_version)
      .def_prop_ro(
          "type", [](const DeviceInfo& info) { return name_of(kDeviceTypes, info.type); },
          "'cpu', 'gpu', 'accelerator' or 'other'.")
      .def_ro("compute_units", &DeviceInfo::compute_units)
      .def_ro("global_memory", &DeviceInfo::global_memory, "Bytes.")
      .def_ro("max_allocation", &DeviceInfo::max_allocation, "Bytes of the largest buffer.")
      .def_ro("problems", &DeviceInfo::problems,
              "Why the device cannot be used; empty when it can.")
      .def_prop_ro("usable", &DeviceInfo::usable)
      .def("__repr__", &describe);
}

}  // namespace

void bind_devices(nb::module_& module) {
  bind_info(module);
  module.def("devices", &devices, "Every OpenCL device of every platform, in the loader's order.");
  using Guard = nb::call_guard<nb::gil_scoped_release>;
  nb::class_<Turn>(module, "_Turn", "What Context.lock() gives.")
      .def("__enter__", &Turn::begin, Guard())
      .def(
          "__exit__", [](Turn& self, const nb::args& /*error*/) { self.end(); },
          nb::sig("def __exit__(self, *error: object) -> None"));
  nb::class_<HeldContext>(
      module, "Context",
      "A device with its queue and compiled kernels. Models and tracers are made with a context "
      "and "
      "keep it alive. Threads that share one take turns; for work at the same time take a context "
      "per thread.")
      .def("__init__", &make_context, nb::arg("device") = "", nb::kw_only(),
           nb::arg("kernel_cache") = true, nb::arg("tuning") = true, nb::arg("profile") = false,
           "device: an index, a part of a name, a DeviceInfo, or '' for the first GPU, else the "
           "first CPU.")
      .def_prop_ro("device", [](HeldContext& self) { return self->device(); })
      .def(
          "lock", [](HeldContext& self) { return new Turn(*self); }, nb::keep_alive<0, 1>(),
          "For `with context.lock():`, within which other threads do not use the context: what "
          "several calls do together, as a picture and its gradients. It may be nested.")
      .def(
          "finish", [](HeldContext& self) { self->finish(); }, Guard(),
          "Blocks until everything enqueued has finished.")
      .def(
          "profile_table", [](HeldContext& self) { return self->profile_table(); }, Guard(),
          "With profile: calls and device time of every kernel so far.")
      .def_prop_ro(
          "build_seconds", [](HeldContext& self) { return self->build_seconds(); },
          "What making kernels has taken, from the cache or by the compiler.")
      .def_prop_ro(
          "allocated_bytes", [](HeldContext& self) { return self->allocated_bytes(); },
          "Bytes in live buffers.")
      .def_prop_ro(
          "peak_allocated_bytes", [](HeldContext& self) { return self->peak_allocated_bytes(); },
          "The most bytes there have been.");
}

}  // namespace raysplats::python
