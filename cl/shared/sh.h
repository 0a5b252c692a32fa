// SPDX-License-Identifier: Apache-2.0
// Real spherical harmonics of degree 0 to 4 with the signs and constants of the 3DGS family (Sloan
// 2008): value and derivative of every basis function for a unit direction. RS_SH_REAL is a float
// or a vector with one direction per lane.
#ifndef RS_SHARED_SH_H
#define RS_SHARED_SH_H

#include "shared/compat.h"

// The basis function of degree 0, 1 / (2 sqrt(pi)).
#ifdef __OPENCL_C_VERSION__
#define RS_SH0 0.28209479177387814f
#else
#define RS_SH0 0.28209479177387814
#endif

#ifndef RS_SH_REAL
#define RS_SH_REAL rs_float
#endif

#ifndef __OPENCL_C_VERSION__
#define RS_SH_FUNCTION inline void
#else
#define RS_SH_FUNCTION void
#endif

// basis[(degree + 1)^2]
RS_SH_FUNCTION rs_sh_basis(
    int degree, RS_SH_REAL x, RS_SH_REAL y, RS_SH_REAL z, RS_SH_REAL* basis) {
  const RS_SH_REAL xx = x * x, yy = y * y, zz = z * z;
  basis[0] = (rs_float)RS_SH0;
  if (degree < 1) return;
  basis[1] = -0.4886025119029199f * y;
  basis[2] = 0.4886025119029199f * z;
  basis[3] = -0.4886025119029199f * x;
  if (degree < 2) return;
  basis[4] = 1.0925484305920792f * x * y;
  basis[5] = -1.0925484305920792f * y * z;
  basis[6] = 0.31539156525252005f * (2.0f * zz - xx - yy);
  basis[7] = -1.0925484305920792f * x * z;
  basis[8] = 0.5462742152960396f * (xx - yy);
  if (degree < 3) return;
  basis[9] = -0.5900435899266435f * y * (3.0f * xx - yy);
  basis[10] = 2.890611442640554f * x * y * z;
  basis[11] = -0.4570457994644658f * y * (4.0f * zz - xx - yy);
  basis[12] = 0.3731763325901154f * z * (2.0f * zz - 3.0f * xx - 3.0f * yy);
  basis[13] = -0.4570457994644658f * x * (4.0f * zz - xx - yy);
  basis[14] = 1.445305721320277f * z * (xx - yy);
  basis[15] = -0.5900435899266435f * x * (xx - 3.0f * yy);
  if (degree < 4) return;
  basis[16] = 2.5033429417967046f * x * y * (xx - yy);
  basis[17] = -1.7701307697799304f * y * z * (3.0f * xx - yy);
  basis[18] = 0.9461746957575601f * x * y * (7.0f * zz - 1.0f);
  basis[19] = -0.6690465435572892f * y * z * (7.0f * zz - 3.0f);
  basis[20] = 0.10578554691520431f * (zz * (35.0f * zz - 30.0f) + 3.0f);
  basis[21] = -0.6690465435572892f * x * z * (7.0f * zz - 3.0f);
  basis[22] = 0.47308734787878004f * (xx - yy) * (7.0f * zz - 1.0f);
  basis[23] = -1.7701307697799304f * x * z * (xx - 3.0f * yy);
  basis[24] = 0.6258357354491761f * (xx * (xx - 3.0f * yy) - yy * (3.0f * xx - yy));
}

// gradient[3] = sum over the functions i > 0 of coefficient[i] * d(basis_i)/d(x, y, z); x, y, z as
// three free variables.
RS_SH_FUNCTION rs_sh_gradient(int degree,
                              RS_SH_REAL x,
                              RS_SH_REAL y,
                              RS_SH_REAL z,
                              const RS_SH_REAL* coefficient,
                              RS_SH_REAL* gradient) {
  const RS_SH_REAL xx = x * x, yy = y * y, zz = z * z;
  const RS_SH_REAL* c = coefficient;
  gradient[0] = gradient[1] = gradient[2] = 0.0f;
  if (degree < 1) return;
  gradient[0] = -0.4886025119029199f * c[3];
  gradient[1] = -0.4886025119029199f * c[1];
  gradient[2] = 0.4886025119029199f * c[2];
  if (degree < 2) return;
  gradient[0] +=
      1.0925484305920792f * (y * c[4] - z * c[7] + x * c[8]) - 0.6307831305050401f * x * c[6];
  gradient[1] +=
      1.0925484305920792f * (x * c[4] - z * c[5] - y * c[8]) - 0.6307831305050401f * y * c[6];
  gradient[2] += 1.2615662610100802f * z * c[6] - 1.0925484305920792f * (y * c[5] + x * c[7]);
  if (degree < 3) return;
  gradient[0] += -3.5402615395598613f * x * y * c[9] + 2.890611442640554f * y * z * c[10] +
                 0.9140915989289316f * x * y * c[11] - 2.2390579957406924f * x * z * c[12] -
                 0.4570457994644658f * (4.0f * zz - 3.0f * xx - yy) * c[13] +
                 2.890611442640554f * x * z * c[14] - 1.7701307697799304f * (xx - yy) * c[15];
  gradient[1] += -1.7701307697799304f * (xx - yy) * c[9] + 2.890611442640554f * x * z * c[10] -
                 0.4570457994644658f * (4.0f * zz - xx - 3.0f * yy) * c[11] -
                 2.2390579957406924f * y * z * c[12] + 0.9140915989289316f * x * y * c[13] -
                 2.890611442640554f * y * z * c[14] + 3.5402615395598613f * x * y * c[15];
  gradient[2] += 2.890611442640554f * x * y * c[10] -
                 3.6563663957157262f * z * (y * c[11] + x * c[13]) +
                 0.3731763325901154f * (6.0f * zz - 3.0f * xx - 3.0f * yy) * c[12] +
                 1.445305721320277f * (xx - yy) * c[14];
  if (degree < 4) return;
  gradient[0] += 2.5033429417967046f * y * (3.0f * xx - yy) * c[16] -
                 10.6207846186795823f * x * y * z * c[17] +
                 0.9461746957575601f * y * (7.0f * zz - 1.0f) * c[18] -
                 0.6690465435572892f * z * (7.0f * zz - 3.0f) * c[21] +
                 0.9461746957575601f * x * (7.0f * zz - 1.0f) * c[22] -
                 5.3103923093397911f * z * (xx - yy) * c[23] +
                 2.5033429417967046f * x * (xx - 3.0f * yy) * c[24];
  gradient[1] += 2.5033429417967046f * x * (xx - 3.0f * yy) * c[16] -
                 5.3103923093397911f * z * (xx - yy) * c[17] +
                 0.9461746957575601f * x * (7.0f * zz - 1.0f) * c[18] -
                 0.6690465435572892f * z * (7.0f * zz - 3.0f) * c[19] -
                 0.9461746957575601f * y * (7.0f * zz - 1.0f) * c[22] +
                 10.6207846186795823f * x * y * z * c[23] +
                 2.5033429417967046f * y * (yy - 3.0f * xx) * c[24];
  gradient[2] += -1.7701307697799304f * y * (3.0f * xx - yy) * c[17] +
                 13.2464457670080411f * x * y * z * c[18] -
                 0.6690465435572892f * y * (21.0f * zz - 3.0f) * c[19] +
                 0.1057855469152043f * z * (140.0f * zz - 60.0f) * c[20] -
                 0.6690465435572892f * x * (21.0f * zz - 3.0f) * c[21] +
                 6.6232228835040206f * z * (xx - yy) * c[22] -
                 1.7701307697799304f * x * (xx - 3.0f * yy) * c[23];
}

#endif
