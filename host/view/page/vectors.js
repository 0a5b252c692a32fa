// SPDX-License-Identifier: Apache-2.0
// Vectors are arrays of three numbers, quaternions [w, x, y, z] of length 1.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a) => Math.hypot(...a);
export const mix = (a, b, t) => a.map((x, i) => x + t * (b[i] - x));

export function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

export function normalized(a) {
  const size = Math.hypot(...a);
  return size > 0 ? a.map((x) => x / size) : a;
}

// v turned by `angle` radians about the unit vector `axis` (Rodrigues).
export function turned(v, axis, angle) {
  const c = Math.cos(angle);
  const s = Math.sin(angle);
  return add(add(scale(v, c), scale(cross(axis, v), s)), scale(axis, dot(axis, v) * (1 - c)));
}

// The quaternion of the rotation whose columns are the three axes.
export function quaternionOf([x, y, z]) {
  const trace = x[0] + y[1] + z[2];
  if (trace > 0) {
    return normalized([1 + trace, y[2] - z[1], z[0] - x[2], x[1] - y[0]]);
  }
  if (x[0] >= y[1] && x[0] >= z[2]) {
    return normalized([y[2] - z[1], 1 + x[0] - y[1] - z[2], y[0] + x[1], z[0] + x[2]]);
  }
  if (y[1] >= z[2]) {
    return normalized([z[0] - x[2], y[0] + x[1], 1 + y[1] - x[0] - z[2], z[1] + y[2]]);
  }
  return normalized([x[1] - y[0], z[0] + x[2], z[1] + y[2], 1 + z[2] - x[0] - y[1]]);
}

// The axes of a quaternion's rotation, as columns.
export function axesOf([w, x, y, z]) {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
    [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
  ];
}

export function slerp(a, b, t) {
  let cosine = a.reduce((sum, x, i) => sum + x * b[i], 0);
  // The short one of the two ways around.
  const other = cosine < 0 ? b.map((x) => -x) : b;
  cosine = Math.min(Math.abs(cosine), 1);
  const angle = Math.acos(cosine);
  if (angle < 1e-4) return normalized(mix(a, other, t));
  const from = Math.sin((1 - t) * angle) / Math.sin(angle);
  const to = Math.sin(t * angle) / Math.sin(angle);
  return normalized(a.map((x, i) => from * x + to * other[i]));
}
