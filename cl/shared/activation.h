// SPDX-License-Identifier: Apache-2.0
// What the trained parameters of opacities and scales stand for: an opacity is the sigmoid of its
// parameter; a standard deviation is exp of its own (Kerbl et al. 2023), or its sigmoid (Byrski et
// al. 2025) in programs with SIGMOID_SCALE 1. RS_ACTIVATED is a float, or a vector of them.
#ifndef RS_SHARED_ACTIVATION_H
#define RS_SHARED_ACTIVATION_H

#ifndef SIGMOID_SCALE
#define SIGMOID_SCALE 0
#endif
#ifndef RS_ACTIVATED
#define RS_ACTIVATED float
#endif

// All scales are below it.
#define RS_LARGEST_SCALE (SIGMOID_SCALE ? 1.0f : INFINITY)

RS_ACTIVATED rs_sigmoid(const RS_ACTIVATED x) { return 1.0f / (1.0f + exp(-x)); }

RS_ACTIVATED rs_scale_of(const RS_ACTIVATED parameter) {
#if SIGMOID_SCALE
  return rs_sigmoid(parameter);
#else
  return exp(parameter);
#endif
}

// The way back, of scales that have a parameter.
RS_ACTIVATED rs_parameter_of_scale(const RS_ACTIVATED scale) {
#if SIGMOID_SCALE
  return log(scale / (1.0f - scale));
#else
  return log(scale);
#endif
}

// Derivative of a scale by its parameter, divided by the scale.
RS_ACTIVATED rs_scale_log_derivative(const RS_ACTIVATED scale) {
#if SIGMOID_SCALE
  return 1.0f - scale;
#else
  (void)scale;
  return (RS_ACTIVATED)(1.0f);
#endif
}

#endif
