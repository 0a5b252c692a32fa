// SPDX-License-Identifier: Apache-2.0
// Gaussians thinner than the pixels of a view, which rays meet or miss by chance, are shown as
// pixels see them on average (after the screen filter of Yu et al. 2024, "Mip-Splatting"): axes
// below the footprint f, a share of a pixel at the mean, are raised to it, and the opacity falls
// with the area of the outline. Along the mean's direction that area is proportional to the root
// of sum_k q_k^2 (s_i s_j)^2, q_k being the part of the mean along axis k and s the axes.
//
// With s'_k the raised axes, r_k = s_k / s'_k and t_k the share of (q_k / s'_k)^2 in their sum, the
// area falls to the root of sum_k t_k (r_i r_j)^2 of what is shown; the opacity is multiplied by
// that to the power RS_FOOTPRINT_POWER.
#ifndef RS_TRACE_VIEW_FOOTPRINT_H
#define RS_TRACE_VIEW_FOOTPRINT_H

// f of the Gaussian.
fv footprint_axis(const ViewGaussian* g, const RsCamera* camera) {
#if LENS == RS_LENS_AROUND
  return camera->footprint * view_distance(g);
#else
  return camera->footprint * larger(g->m[2], (fv)(0.0f));
#endif
}

typedef struct {
  fv along[3];   // q_k
  fv ratio2[3];  // r_k^2
  fv whitened;   // sum of (q_k / s'_k)^2
  fv kept;       // sum of t_k (r_i r_j)^2
} FootprintShares;

// Whether axis k was raised, by more than rounding.
iv footprint_raised(const FootprintShares* s, const int k) { return s->ratio2[k] < 0.999999f; }

// (r_i r_j)^2
fv footprint_pair(const FootprintShares* s, const int k) {
  return s->ratio2[(k + 1) % 3] * s->ratio2[(k + 2) % 3];
}

// Reads the own scales, the raised ones' reciprocals, the rotation and the mean.
void footprint_shares(const ViewGaussian* g, FootprintShares* out) {
  const fv thinnest = thinnest_axis(view_distance(g));
  out->whitened = 1e-30f;  // a mean at the camera has no direction, and no opacity is left
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const fv ratio = larger(g->raw_scale[k], thinnest) * g->w[k];
    out->ratio2[k] = ratio * ratio;
    out->along[k] =
        g->axis[3 * k] * g->m[0] + g->axis[3 * k + 1] * g->m[1] + g->axis[3 * k + 2] * g->m[2];
    const fv q = out->along[k] * g->w[k];
    out->whitened += q * q;
  }
  out->kept = 0;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const fv q = out->along[k] * g->w[k];
    out->kept += q * q * footprint_pair(out, k);
  }
  out->kept = smaller(out->kept / out->whitened, (fv)(1.0f));
}

// What is left of the opacity: `kept` to half of RS_FOOTPRINT_POWER, 5/8.
fv footprint_dilution(const FootprintShares* s) {
  const fv root = sqrt(s->kept);
  return root * sqrt(sqrt(root));
}

#endif
