// SPDX-License-Identifier: Apache-2.0
// A step of Adam (Kingma and Ba 2015) for the coefficients of the sky. Launch: one work-item per
// number. steps[k]: steps of that number so far. Does nothing where the guard's word is not 0 or
// the gradient is not finite. Complexity: O(1) each.

__kernel void sky_step(const __global float* gradient,
                       const __global uint* guard,
                       __global float* coefficients,
                       __global float* first,
                       __global float* second,
                       __global float* steps,
                       uint numbers,
                       float rate,
                       float beta1,
                       float beta2,
                       float epsilon) {
  const uint k = get_global_id(0);
  if (k >= numbers || guard[0] != 0) return;
  const float g = gradient[k];
  if ((as_uint(g) & 0x7f800000u) == 0x7f800000u) return;
  const float step = steps[k] + 1.0f;
  steps[k] = step;
  first[k] = beta1 * first[k] + (1.0f - beta1) * g;
  second[k] = beta2 * second[k] + (1.0f - beta2) * g * g;
  const float mean = first[k] / (1.0f - pow(beta1, step));
  const float square = second[k] / (1.0f - pow(beta2, step));
  coefficients[k] -= rate * mean / (sqrt(square) + epsilon);
}
