// SPDX-License-Identifier: Apache-2.0
#include "trace/device_gaussians.hpp"

#include <algorithm>
#include <cmath>

namespace raysplats {
namespace {

Buffer<float> to_device(Context& context, const std::vector<float>& values, const char* label) {
  Buffer<float> buffer(context, values.size(), label);
  buffer.upload(values);
  return buffer;
}

// logit(exp(l)): the sigmoid parameter of the same standard deviation, which has to stay below 1.
float sigmoid_parameter(float log_scale) {
  const double scale = std::clamp(std::exp(static_cast<double>(log_scale)), 1e-12, 1.0 - 1e-6);
  return static_cast<float>(std::log(scale) - std::log1p(-scale));
}

// log(sigmoid(s)) without overflow for either sign.
float log_sigmoid(float s) {
  const double x = s;
  return static_cast<float>(x < 0 ? x - std::log1p(std::exp(x)) : -std::log1p(std::exp(-x)));
}

}  // namespace

DeviceGaussians DeviceGaussians::upload(Context& context,
                                        const Gaussians& model,
                                        ScaleActivation activation) {
  DeviceGaussians out;
  out.count = model.size();
  out.sh_degree = out.active_sh_degree = model.sh_degree;
  out.activation = activation;
  std::vector<float> scales = model.log_scales;
  if (activation == ScaleActivation::kSigmoid)
    std::transform(scales.begin(), scales.end(), scales.begin(), sigmoid_parameter);
  out.means = to_device(context, model.means, "means");
  out.quaternions = to_device(context, model.quaternions, "quaternions");
  out.scales = to_device(context, scales, "scales");
  out.opacities = to_device(context, model.opacities, "opacities");
  out.sh = to_device(context, model.sh, "spherical harmonics");
  out.changed(context);
  return out;
}

void GaussianGradients::ensure(Context& context, const DeviceGaussians& gaussians) {
  Parameters::ensure(context, gaussians.count, gaussians.sh_degree, "gradients");
  screen.ensure(context, kScreenNumbers * gaussians.count, "screen gradients");
}

Gaussians DeviceGaussians::download() const {
  Gaussians model;
  model.sh_degree = sh_degree;
  model.means = means.download();
  model.quaternions = quaternions.download();
  model.log_scales = scales.download();
  if (activation == ScaleActivation::kSigmoid) {
    std::transform(model.log_scales.begin(), model.log_scales.end(), model.log_scales.begin(),
                   log_sigmoid);
  }
  model.opacities = opacities.download();
  model.sh = sh.download();
  return model;
}

}  // namespace raysplats
