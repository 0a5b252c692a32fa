// SPDX-License-Identifier: Apache-2.0
#include "raysplats/opencl.hpp"

#include <array>
#include <memory>

#include "device/foreign_opencl.hpp"
#include "trace/model_impl.hpp"

namespace raysplats {
namespace {

struct Group {
  const Buffer<float>& own;
  cl_mem foreign;
  const char* what;
  std::size_t bytes() const { return own.size() * sizeof(float); }
};

std::array<Group, 5> groups(const DeviceGaussians& own, const GaussianBuffers& foreign) {
  return {{{own.means, foreign.means, "the means"},
           {own.quaternions, foreign.quaternions, "the quaternions"},
           {own.scales, foreign.log_scales, "the log_scales"},
           {own.opacities, foreign.opacities, "the opacities"},
           {own.sh, foreign.sh, "the sh coefficients"}}};
}

}  // namespace

std::unique_ptr<Context> make_context(cl_command_queue queue, const ContextOptions& options) {
  return adopt_queue(queue, options);
}

cl_command_queue opencl_queue(Context& context) { return queue_of(context); }

void copy_gaussians(const GaussianBuffers& source, Model& target) {
  Context& context = target.context();
  const auto turn = context.lock();
  DeviceGaussians& own = target.impl().gaussians;
  // All are looked at before the first is copied.
  for (const Group& group : groups(own, source))
    check_foreign(context, group.foreign, group.bytes(), group.what);
  for (const Group& group : groups(own, source))
    copy_in(context, group.foreign, group.own.raw(), group.bytes(), group.what);
  own.changed(context);
}

void copy_gaussians(const Model& source, const GaussianBuffers& target) {
  Context& context = source.context();
  const auto turn = context.lock();
  const DeviceGaussians& own = source.impl().gaussians;
  for (const Group& group : groups(own, target))
    check_foreign(context, group.foreign, group.bytes(), group.what);
  for (const Group& group : groups(own, target))
    copy_out(context, group.own.raw(), group.foreign, group.bytes(), group.what);
}

}  // namespace raysplats
