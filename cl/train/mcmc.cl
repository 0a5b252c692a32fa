// SPDX-License-Identifier: Apache-2.0
// What "3D Gaussian Splatting as Markov Chain Monte Carlo" (Kheradmand et al. 2024) does beside the
// gradient step: pressure on opacities and sizes, noise on the means, and the equal shares into
// which a Gaussian is divided.
//
// Launch: one work-item per Gaussian, any group size. A guard word that is not 0 turns mcmc_press
// and mcmc_noise off. Complexity: O(N); no work-item reads what another one writes.
#include "shared/activation.h"
#include "shared/random.h"

// Noise that moves nothing to speak of is not drawn: opacities above 0.074.
#define LEAST_GATE 1e-3f

// d scale / d parameter.
float mcmc_scale_derivative(float parameter) {
  const float scale = rs_scale_of(parameter);
  return scale * rs_scale_log_derivative(scale);
}

// Adds the gradients of opacity_weight * (sum of opacities) + scale_weight * (sum of standard
// deviations).
__kernel void mcmc_press(uint count,
                         float opacity_weight,
                         float scale_weight,
                         __global const uint* guard,
                         __global const float* opacities,
                         __global const float* scales,
                         __global float* opacity_gradient,
                         __global float* scale_gradient) {
  const size_t i = get_global_id(0);
  if (i >= count || guard[0] != 0) return;
  const float opacity = rs_sigmoid(opacities[i]);
  opacity_gradient[i] += opacity_weight * opacity * rs_sigmoid(-opacities[i]);
  const float3 scale = vload3(i, scales);
  const float3 derivative = (float3)(mcmc_scale_derivative(scale.x), mcmc_scale_derivative(scale.y),
                                     mcmc_scale_derivative(scale.z));
  vstore3(vload3(i, scale_gradient) + scale_weight * derivative, i, scale_gradient);
}

// mean += strength * gate(opacity) * covariance * (three standard normal numbers); gate falls from
// 1 to 0 around an opacity of 0.005. The numbers are functions of the key and i (Box and Muller
// 1958).
__kernel void mcmc_noise(uint count,
                         uint key_low,
                         uint key_high,
                         float strength,
                         __global const uint* guard,
                         __global const float* quaternions,
                         __global const float* scales,
                         __global const float* opacities,
                         __global float* means) {
  const size_t i = get_global_id(0);
  if (i >= count || guard[0] != 0) return;
  const float opacity = rs_sigmoid(opacities[i]);
  const float gate = 1.0f / (1.0f + exp(100.0f * (opacity - 0.005f)));
  if (!(gate > LEAST_GATE)) return;
  const RsRandom4 u = rs_random4(key_low, key_high, (uint)i, 0, 0);
  // 1 - u lies in (0, 1]: the logarithm stays finite.
  const float near_radius = sqrt(-2.0f * log(1.0f - u.x));
  const float far_radius = sqrt(-2.0f * log(1.0f - u.y));
  const float3 normal = (float3)(near_radius * cospi(2.0f * u.z), near_radius * sinpi(2.0f * u.z),
                                 far_radius * cospi(2.0f * u.w));
  // covariance * normal = R S S R^T normal, with the rotation as a quaternion (real, i, j, k).
  float4 q = vload4(i, quaternions);
  q *= rsqrt(fmax(dot(q, q), 1e-30f));
  const float3 axis = q.yzw;
  const float3 t = 2.0f * cross(axis, normal);
  float3 v = normal - q.x * t + cross(axis, t);
  const float3 parameter = vload3(i, scales);
  const float3 s =
      (float3)(rs_scale_of(parameter.x), rs_scale_of(parameter.y), rs_scale_of(parameter.z));
  v *= s * s;
  const float3 back = 2.0f * cross(axis, v);
  v += q.x * back + cross(axis, back);
  vstore3(vload3(i, means) + strength * gate * v, i, means);
}

// shares[i]: {opacity parameter, factor of the standard deviations}; a factor of 0 leaves the
// Gaussian as it is.
__kernel void mcmc_share(uint count,
                         __global const float2* shares,
                         __global float* opacities,
                         __global float* scales) {
  const size_t i = get_global_id(0);
  if (i >= count || shares[i].y == 0.0f) return;
  opacities[i] = shares[i].x;
  const float3 parameter = vload3(i, scales);
#if SIGMOID_SCALE
  const float3 s = shares[i].y * (float3)(rs_scale_of(parameter.x), rs_scale_of(parameter.y),
                                          rs_scale_of(parameter.z));
  vstore3(log(s / (1.0f - s)), i, scales);
#else
  vstore3(parameter + log(shares[i].y), i, scales);
#endif
}
