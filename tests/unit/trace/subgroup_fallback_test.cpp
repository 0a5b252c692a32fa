// SPDX-License-Identifier: Apache-2.0
#define CL_TARGET_OPENCL_VERSION 300
#include <CL/cl.h>
#include <dlfcn.h>
#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string_view>
#include <tuple>

#include "build_paths.hpp"
#include "raysplats/error.hpp"
#include "skip_test.hpp"
#include "unit/temporary_directory.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

constexpr int kRays = 64;

// Drivers without subgroups lack the function that tells how many a packet is: then it is two.
bool several_subgroups = false;

cl_int CL_API_CALL two_subgroups(cl_kernel,
                                 cl_device_id,
                                 cl_kernel_sub_group_info,
                                 size_t,
                                 const void*,
                                 size_t,
                                 void* value,
                                 size_t*) {
  *static_cast<std::size_t*>(value) = 2;
  return CL_SUCCESS;
}

// The test device as a GPU with subgroups, of which it makes two of a packet of kRays.
class SeveralSubgroups {
 public:
  ~SeveralSubgroups() { several_subgroups = false; }
  SeveralSubgroups() : device_(test_device()) {
    // Kernels with subgroups have to compile where there are none. None of these is launched.
    if (!device_.has_subgroups) {
      namespace fs = std::filesystem;
      const fs::path kernels = folder_.path() / "cl";
      fs::copy(fs::path(test::source_dir()) / "cl", kernels, fs::copy_options::recursive);
      std::ifstream file(kernels / "trace/group.h");
      const std::string text{std::istreambuf_iterator<char>(file), {}};
      file.close();
      std::ofstream(kernels / "trace/group.h")
          << "#define sub_group_barrier(fence) barrier(fence)\n"
             "#define get_sub_group_local_id() get_local_id(0)\n"
             "#define sub_group_reduce_add(value) (value)\n"
             "#define sub_group_reduce_min(value) (value)\n"
             "#define sub_group_reduce_max(value) (value)\n"
             "#define sub_group_any(value) (value)\n"
             "#define sub_group_ballot(value) ((uint4)(value))\n"
          << text;
      options_.kernel_directory = kernels.string();
      several_subgroups = true;
    }
    device_.type = DeviceType::kGpu;
    device_.has_subgroups = true;
  }

  // Picture, gradients of the means in exact sums, and the programs that were compiled.
  std::tuple<std::vector<float>, std::vector<float>, std::size_t> trace(PacketShape shape) {
    ContextOptions options = options_;
    options.kernel_cache = false;
    std::size_t compiled = 0;
    options.compiling = [&](std::size_t number, const std::string&) { compiled = number; };
    Context context(device_, options);
    TraceOptions trace;
    trace.packet_shape = shape;
    trace.packet_width = kRays;
    trace.gradient_sum = GradientSum::kExact;
    const Camera camera = reference::cube_camera(9, 7);
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, reference::random_scene(20, 18, 0), ScaleActivation::kExp);
    CameraTracer tracer(context, trace);
    tracer.update(gaussians);
    tracer.forward(gaussians, camera, true);
    const std::vector<float> numbers = random_image_gradient(9 * 7, 3);
    Buffer<float> gradient(context, numbers.size(), "image gradient");
    gradient.upload(numbers);
    GaussianGradients out;
    tracer.backward(gaussians, gradient, out);
    return {tracer.download_image().data, HostGradients(out).means, compiled};
  }

 private:
  TemporaryDirectory folder_;
  DeviceInfo device_;
  ContextOptions options_;
};

}  // namespace

// In place of the loader's own function.
extern "C" void* clGetExtensionFunctionAddressForPlatform(cl_platform_id platform,
                                                          const char* name) {
  if (several_subgroups && std::string_view(name) == "clGetKernelSubGroupInfoKHR")
    return reinterpret_cast<void*>(&two_subgroups);
  const auto loader = reinterpret_cast<decltype(&clGetExtensionFunctionAddressForPlatform)>(
      dlsym(RTLD_NEXT, __func__));
  return loader(platform, name);
}

TEST_CASE("packets that become several subgroups are traced as groups unless demanded otherwise") {
  SeveralSubgroups device;
  std::string refusal;
  try {
    device.trace(PacketShape::kSubgroup);
  } catch (const DeviceError& error) {
    refusal = error.what();
  }
  SKIP_TEST_UNLESS(!refusal.empty(), "64 work-items are one subgroup here: nothing falls back");
  CHECK(refusal.find("subgroups of a packet of 64 rays in kernel trace_forward_group") !=
        std::string::npos);
  const auto [image, means, compiled] = device.trace(PacketShape::kAuto);
  const auto [group_image, group_means, group_compiled] = device.trace(PacketShape::kGroup);
  CHECK(image == group_image);
  CHECK(means == group_means);
  // The forward kernel with subgroups was tried, in vain, and the backward one not even that.
  CHECK(compiled == group_compiled + 1);
}
