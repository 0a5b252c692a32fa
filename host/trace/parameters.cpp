// SPDX-License-Identifier: Apache-2.0
#include "trace/parameters.hpp"

#include "raysplats/gaussians.hpp"

namespace raysplats {
namespace {

constexpr std::array<const char*, kParameterGroups.size()> kNames{"means", "quaternions", "scales",
                                                                  "opacities", "sh"};
constexpr std::array<Buffer<float> Parameters::*, kParameterGroups.size()> kMembers{
    &Parameters::means, &Parameters::quaternions, &Parameters::scales, &Parameters::opacities,
    &Parameters::sh};

std::size_t index(ParameterGroup group) { return static_cast<std::size_t>(group); }

}  // namespace

const char* group_name(ParameterGroup group) { return kNames.at(index(group)); }

std::size_t group_width(ParameterGroup group, int sh_degree) {
  constexpr std::array<std::size_t, kParameterGroups.size() - 1> kWidths{3, 4, 3, 1};
  return group == ParameterGroup::kSh ? 3 * static_cast<std::size_t>(sh_coefficients(sh_degree))
                                      : kWidths.at(index(group));
}

Buffer<float>& Parameters::operator[](ParameterGroup group) {
  return this->*kMembers.at(index(group));
}

const Buffer<float>& Parameters::operator[](ParameterGroup group) const {
  return this->*kMembers.at(index(group));
}

void Parameters::ensure(Context& context,
                        std::size_t count,
                        int sh_degree,
                        const std::string& what) {
  for_each_group(
      [&](ParameterGroup group, Buffer<float>& buffer) {
        buffer.ensure(context, count * group_width(group, sh_degree),
                      what + " of " + group_name(group));
      },
      *this);
}

}  // namespace raysplats
