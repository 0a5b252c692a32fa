// SPDX-License-Identifier: Apache-2.0
#include "raysplats/opencl.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "device/cl.hpp"
#include "device/platform.hpp"
#include "raysplats/error.hpp"
#include "reference/scenes.hpp"
#include "unit/text.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;
using test::contains;
using test::message_of;

namespace {

/// What a program with OpenCL of its own has, on the device of the tests.
struct Own {
  explicit Own(cl_command_queue_properties properties = 0) {
    const DeviceInfo info = test_device();
    for (const PlatformDevice& entry : platform_devices()) {
      if (entry.info.index == info.index) device = entry.device;
    }
    context = cl::Context(device);
    queue = cl::CommandQueue(context, device, properties);
  }
  template <class T>
  cl::Buffer buffer(const std::vector<T>& values) const {
    cl::Buffer out(context, CL_MEM_READ_WRITE, values.size() * sizeof(T));
    queue.enqueueWriteBuffer(out, CL_TRUE, 0, values.size() * sizeof(T), values.data());
    return out;
  }
  template <class T>
  std::vector<T> read(const cl::Buffer& source, std::size_t count) const {
    std::vector<T> out(count);
    queue.enqueueReadBuffer(source, CL_TRUE, 0, count * sizeof(T), out.data());
    return out;
  }

  cl::Device device;
  cl::Context context;
  cl::CommandQueue queue;
};

}  // namespace

TEST_CASE("a queue and buffers of the caller's trace what the host's arrays trace") {
  const Own own;
  const Gaussians gaussians = reference::random_scene(200, 7, 1);
  const std::vector<Ray> rays{{{0, 0, -4}, 0, {0, 0, 1}, 100},
                              {{0.3f, 0.1f, -4}, 0, {0, 0.1f, 2}, 100},
                              {{0, 0.2f, 4}, 0, {0, 0, -1}, 100}};
  const auto context = make_context(own.queue());
  CHECK(opencl_queue(*context) == own.queue());
  Model model(*context, gaussians);
  Tracer tracer(*context);
  const std::vector<RayResult> expected = tracer.trace(model, rays);
  CHECK(expected[0].hits > 0);

  const cl::Buffer device_rays = own.buffer(rays);
  const cl::Buffer results = own.buffer(std::vector<RayResult>(rays.size()));
  const auto same = [&](const std::vector<RayResult>& wanted) {
    const auto got = own.read<RayResult>(results, rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) {
      CHECK(got[i].alpha == wanted[i].alpha);
      CHECK(got[i].color[1] == wanted[i].color[1]);
      CHECK(got[i].hits == wanted[i].hits);
    }
  };
  trace(tracer, model, device_rays(), rays.size(), results());
  same(expected);

  // Out, changed by the caller, and in again.
  const cl::Buffer means = own.buffer(std::vector<float>(gaussians.means.size()));
  const cl::Buffer quaternions = own.buffer(std::vector<float>(gaussians.quaternions.size()));
  const cl::Buffer scales = own.buffer(std::vector<float>(gaussians.log_scales.size()));
  const cl::Buffer opacities = own.buffer(std::vector<float>(gaussians.opacities.size()));
  const cl::Buffer sh = own.buffer(std::vector<float>(gaussians.sh.size()));
  const GaussianBuffers all{means(), quaternions(), scales(), opacities(), sh()};
  copy_gaussians(model, all);
  CHECK(own.read<float>(means, gaussians.means.size()) == gaussians.means);
  CHECK(own.read<float>(sh, gaussians.sh.size()) == gaussians.sh);
  own.queue.enqueueFillBuffer(opacities, -2.0f, 0, gaussians.opacities.size() * sizeof(float));
  const std::uint64_t before = model.revision();
  copy_gaussians(all, model);
  CHECK(model.revision() != before);
  Gaussians faint = gaussians;
  std::fill(faint.opacities.begin(), faint.opacities.end(), -2.0f);
  CHECK(model.download().opacities == faint.opacities);
  trace(tracer, model, device_rays(), rays.size(), results());
  same(Tracer(*context).trace(Model(*context, faint), rays));
}

TEST_CASE("queues and buffers that do not fit are refused") {
  CHECK(contains(message_of<UsageError>([] { make_context(nullptr); }), "no command queue"));
  const Own unordered(CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE);
  CHECK(contains(message_of<UsageError>([&] { make_context(unordered.queue()); }), "out of order"));
  const Own own;
  ContextOptions timed;
  timed.profile = true;
  CHECK(contains(message_of<UsageError>([&] { make_context(own.queue(), timed); }),
                 "CL_QUEUE_PROFILING_ENABLE"));

  const auto context = make_context(own.queue());
  const Gaussians gaussians = reference::random_scene(20, 7, 0);
  Model model(*context, gaussians);
  Tracer tracer(*context);
  const cl::Buffer small = own.buffer(std::vector<float>(8));
  const cl::Buffer large = own.buffer(std::vector<float>(1000));
  const Own other;
  const cl::Buffer elsewhere = other.buffer(std::vector<float>(1000));
  GaussianBuffers buffers{large(), large(), large(), large(), nullptr};
  const std::uint64_t revision = model.revision();
  CHECK(contains(message_of<UsageError>([&] { copy_gaussians(buffers, model); }), "sh"));
  buffers.sh = large();
  buffers.means = small();
  CHECK(
      contains(message_of<UsageError>([&] { copy_gaussians(buffers, model); }), "240 are needed"));
  CHECK(
      contains(message_of<UsageError>([&] { copy_gaussians(model, buffers); }), "240 are needed"));
  buffers.means = elsewhere();
  CHECK(contains(message_of<UsageError>([&] { copy_gaussians(buffers, model); }),
                 "another cl_context"));
  CHECK(model.revision() == revision);
  CHECK(model.download().means == gaussians.means);
  CHECK(contains(message_of<UsageError>([&] { trace(tracer, model, small(), 2, large()); }),
                 "64 are needed"));
  CHECK(contains(message_of<UsageError>([&] { trace(tracer, model, large(), 2, nullptr); }),
                 "missing"));
}

TEST_CASE("launches keep to their time on a caller's queue that takes no times as well") {
  const Own own;
  const auto context = make_context(own.queue());
  const Gaussians gaussians = reference::random_scene(200, 7, 1);
  const Camera camera = reference::cube_camera(64, 60);
  TraceOptions options;
  options.launch_budget_ms = 0.0;
  const Image whole = trace_image(*context, gaussians, options, camera);
  options.launch_budget_ms = 0.001;
  const std::uint64_t waits = context->host_waits();
  CHECK(trace_image(*context, gaussians, options, camera).data == whole.data);
  CHECK(context->host_waits() > waits + 4);  // two for every band
}
