// SPDX-License-Identifier: Apache-2.0
#include "train/model_validator.hpp"

#include <fmt/format.h>

#include <array>
#include <vector>

#include "raysplats/gaussians.hpp"
#include "trace/ray_tree_validate.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroupSize = 64;
constexpr std::size_t kCpuChunk = 1024;
constexpr std::size_t kGpuChunk = 4;

}  // namespace

ModelValidator::ModelValidator(Context& context, const TraceOptions& options)
    : context_(context),
      chunk_(context.device().type == DeviceType::kCpu ? kCpuChunk : kGpuChunk),
      kernel_(context.kernel("train/model_validator.cl", "find_non_finite")),
      tree_(context, options, tree_form(context.device())),
      found_(context, 2, "validation") {}

std::string ModelValidator::find_non_finite(const Numbers& numbers, const std::string& name) {
  found_.upload(std::array<std::uint32_t, 2>{0, 0xffffffffu});
  kernel_.launch(Range::linear((numbers.count + chunk_ - 1) / chunk_, kGroupSize),
                 BufferAs<std::uint32_t>{numbers.buffer->raw()}, found_,
                 std::uint64_t{numbers.first}, u32(numbers.count), u32(numbers.width), u32(chunk_));
  const std::vector<std::uint32_t> found = found_.download();
  if (found[0] == 0) return "";
  return fmt::format("{} numbers of '{}' are not finite, the first of them in Gaussian {}",
                     found[0], name, found[1]);
}

std::string ModelValidator::find_fault(const DeviceGaussians& gaussians,
                                       const Adam& adam,
                                       RayTracer* rays) {
  if (gaussians.count == 0) return "";
  for (const ParameterGroup group : kParameterGroups) {
    const std::string name = group_name(group);
    const std::size_t width = group_width(group, gaussians.sh_degree);
    std::string fault = find_non_finite({&gaussians[group], 0, gaussians.count, width}, name);
    if (!fault.empty()) return fault;
    for (const auto& [moments, what] : {std::pair(&adam.first_moments(), "first moments of "),
                                        std::pair(&adam.second_moments(), "second moments of ")}) {
      if (moments->size() == 0) continue;
      fault =
          find_non_finite({moments, adam.moment_place(group), gaussians.count, width}, what + name);
      if (!fault.empty()) return fault;
    }
  }
  const bool built = rays != nullptr ? rays->follow(gaussians) : tree_.follow(gaussians);
  return validate_ray_tree(RayTreeCopy::of(rays != nullptr ? rays->tree() : tree_),
                           gaussians.download(), built ? LeafOrder::kCurve : LeafOrder::kAny);
}

}  // namespace raysplats
