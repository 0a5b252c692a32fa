// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/group_parts.hpp"

namespace raysplats {

static_assert(kParameterGroups.size() == RS_PARAMETER_GROUPS);

GroupParts group_parts(std::size_t count, int sh_degree, std::size_t group, std::size_t floats) {
  GroupParts out{};
  std::size_t groups = 0;
  for (const ParameterGroup of : kParameterGroups) {
    const std::size_t items = (count * group_width(of, sh_degree) + floats - 1) / floats;
    groups += (items + group - 1) / group;
    out.parts.first[static_cast<std::size_t>(of) + 1] = u32(groups);
  }
  out.range = Range::linear(groups * group, group);
  return out;
}

GroupParts group_blocks(std::size_t blocks) {
  GroupParts out{};
  for (std::size_t i = 0; i <= kParameterGroups.size(); ++i) out.parts.first[i] = u32(i * blocks);
  out.range = Range::linear(kParameterGroups.size() * blocks, 1);
  return out;
}

}  // namespace raysplats
