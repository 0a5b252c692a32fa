// SPDX-License-Identifier: Apache-2.0
#include "trace/gaussian_kernel.hpp"

namespace raysplats {
namespace {

// Work-items of a group: at least a whole wave of a GPU (64 on AMD's), or a few vectors of a CPU.
constexpr std::size_t kGpuGroup = 64;
constexpr std::size_t kCpuGroup = 16;

std::size_t gaussians_per_item(const DeviceInfo& device) {
  // GPUs run one Gaussian per lane of their own accord.
  if (device.type != DeviceType::kCpu) return 1;
  if (device.float_vector_width >= 16) return 16;
  return device.float_vector_width >= 8 ? 8 : 4;
}

}  // namespace

GaussianKernel::GaussianKernel(Context& context,
                               const std::string& file,
                               const std::string& name,
                               const BuildOptions& build)
    : width_(gaussians_per_item(context.device())),
      group_(context.device().type == DeviceType::kCpu ? kCpuGroup : kGpuGroup) {
  BuildOptions wide = build;
  wide.define("LANES", width_);
  // Rows of the group's Gaussians go through local memory (cl/trace/staged_rows.h).
  if (context.device().type != DeviceType::kCpu) wide.define("GROUP", group_);
  wide_ = context.kernel(file, name, wide);
  BuildOptions single = build;
  single_ = width_ == 1 ? wide_ : context.kernel(file, name, single.define("LANES", 1));
}

}  // namespace raysplats
