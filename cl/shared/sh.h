// SPDX-License-Identifier: Apache-2.0
// Real spherical harmonics of degree 0 to 4 with the signs and constants of the 3DGS family (Sloan
// 2008): value and derivative of every basis function for a unit direction.
#ifndef RS_SHARED_SH_H
#define RS_SHARED_SH_H

#include "shared/compat.h"

#ifndef __OPENCL_C_VERSION__
#define RS_SH_FUNCTION inline void
#else
#define RS_SH_FUNCTION void
#endif

// basis[(degree + 1)^2]
RS_SH_FUNCTION rs_sh_basis(int degree, rs_float x, rs_float y, rs_float z, rs_float* basis) {
  const rs_float xx = x * x, yy = y * y, zz = z * z;
  basis[0] = 0.28209479177387814f;
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

// Adds coefficient * d(basis_i)/d(x, y, z) of function i to gradient[3]; x, y, z as three free
// variables.
RS_SH_FUNCTION rs_sh_gradient(
    int i, rs_float x, rs_float y, rs_float z, rs_float coefficient, rs_float* gradient) {
  const rs_float xx = x * x, yy = y * y, zz = z * z;
  rs_float gx = 0.0f, gy = 0.0f, gz = 0.0f;
  switch (i) {
    case 1:
      gy = -0.4886025119029199f;
      break;
    case 2:
      gz = 0.4886025119029199f;
      break;
    case 3:
      gx = -0.4886025119029199f;
      break;
    case 4:
      gx = 1.0925484305920792f * y;
      gy = 1.0925484305920792f * x;
      break;
    case 5:
      gy = -1.0925484305920792f * z;
      gz = -1.0925484305920792f * y;
      break;
    case 6:
      gx = -0.6307831305050401f * x;
      gy = -0.6307831305050401f * y;
      gz = 1.2615662610100802f * z;
      break;
    case 7:
      gx = -1.0925484305920792f * z;
      gz = -1.0925484305920792f * x;
      break;
    case 8:
      gx = 1.0925484305920792f * x;
      gy = -1.0925484305920792f * y;
      break;
    case 9:
      gx = -0.5900435899266435f * 6.0f * x * y;
      gy = -0.5900435899266435f * 3.0f * (xx - yy);
      break;
    case 10:
      gx = 2.890611442640554f * y * z;
      gy = 2.890611442640554f * x * z;
      gz = 2.890611442640554f * x * y;
      break;
    case 11:
      gx = 0.4570457994644658f * 2.0f * x * y;
      gy = -0.4570457994644658f * (4.0f * zz - xx - 3.0f * yy);
      gz = -0.4570457994644658f * 8.0f * y * z;
      break;
    case 12:
      gx = -0.3731763325901154f * 6.0f * x * z;
      gy = -0.3731763325901154f * 6.0f * y * z;
      gz = 0.3731763325901154f * (6.0f * zz - 3.0f * xx - 3.0f * yy);
      break;
    case 13:
      gx = -0.4570457994644658f * (4.0f * zz - 3.0f * xx - yy);
      gy = 0.4570457994644658f * 2.0f * x * y;
      gz = -0.4570457994644658f * 8.0f * x * z;
      break;
    case 14:
      gx = 1.445305721320277f * 2.0f * x * z;
      gy = -1.445305721320277f * 2.0f * y * z;
      gz = 1.445305721320277f * (xx - yy);
      break;
    case 15:
      gx = -0.5900435899266435f * 3.0f * (xx - yy);
      gy = 0.5900435899266435f * 6.0f * x * y;
      break;
    case 16:
      gx = 2.5033429417967046f * y * (3.0f * xx - yy);
      gy = 2.5033429417967046f * x * (xx - 3.0f * yy);
      break;
    case 17:
      gx = -1.7701307697799304f * 6.0f * x * y * z;
      gy = -1.7701307697799304f * 3.0f * z * (xx - yy);
      gz = -1.7701307697799304f * y * (3.0f * xx - yy);
      break;
    case 18:
      gx = 0.9461746957575601f * y * (7.0f * zz - 1.0f);
      gy = 0.9461746957575601f * x * (7.0f * zz - 1.0f);
      gz = 0.9461746957575601f * 14.0f * x * y * z;
      break;
    case 19:
      gy = -0.6690465435572892f * z * (7.0f * zz - 3.0f);
      gz = -0.6690465435572892f * y * (21.0f * zz - 3.0f);
      break;
    case 20:
      gz = 0.10578554691520431f * z * (140.0f * zz - 60.0f);
      break;
    case 21:
      gx = -0.6690465435572892f * z * (7.0f * zz - 3.0f);
      gz = -0.6690465435572892f * x * (21.0f * zz - 3.0f);
      break;
    case 22:
      gx = 0.47308734787878004f * 2.0f * x * (7.0f * zz - 1.0f);
      gy = -0.47308734787878004f * 2.0f * y * (7.0f * zz - 1.0f);
      gz = 0.47308734787878004f * 14.0f * z * (xx - yy);
      break;
    case 23:
      gx = -1.7701307697799304f * 3.0f * z * (xx - yy);
      gy = 1.7701307697799304f * 6.0f * x * y * z;
      gz = -1.7701307697799304f * x * (xx - 3.0f * yy);
      break;
    case 24:
      gx = 0.6258357354491761f * 4.0f * x * (xx - 3.0f * yy);
      gy = 0.6258357354491761f * 4.0f * y * (yy - 3.0f * xx);
      break;
    default:
      break;
  }
  gradient[0] += coefficient * gx;
  gradient[1] += coefficient * gy;
  gradient[2] += coefficient * gz;
}

#endif
