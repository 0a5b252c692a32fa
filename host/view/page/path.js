// SPDX-License-Identifier: Apache-2.0
// Camera paths through keyframes, and the file that `raysplats render --cameras` reads.

import * as v from './vectors.js';

// Centripetal Catmull-Rom (Yuksel, Schaefer and Keyser 2011) between p1 and p2.
function smooth(p0, p1, p2, p3, t) {
  const knots = [0];
  const points = [p0, p1, p2, p3];
  for (let i = 1; i < 4; ++i) {
    const gap = Math.sqrt(v.length(v.sub(points[i], points[i - 1])));
    knots.push(knots[i - 1] + Math.max(gap, 1e-6));
  }
  const at = knots[1] + t * (knots[2] - knots[1]);
  const between = (a, b, i, j) => v.mix(a, b, (at - knots[i]) / (knots[j] - knots[i]));
  const a = [0, 1, 2].map((i) => between(points[i], points[i + 1], i, i + 1));
  const b = [between(a[0], a[1], 0, 2), between(a[1], a[2], 1, 3)];
  return between(b[0], b[1], 1, 2);
}

// The view at `share` (0 to 1) of the path.
export function viewAt(keys, share, closed) {
  if (keys.length === 1) return keys[0];
  const spans = closed ? keys.length : keys.length - 1;
  const place = Math.min(share * spans, spans - 1e-9);
  const index = Math.floor(place);
  const t = place - index;
  const key = (i) => (closed ? keys[(i + keys.length) % keys.length]
    : keys[Math.min(Math.max(i, 0), keys.length - 1)]);
  const [a, b] = [key(index), key(index + 1)];
  return {
    eye: smooth(key(index - 1).eye, a.eye, b.eye, key(index + 2).eye, t),
    turn: v.slerp(a.turn, b.turn, t),
    fov: a.fov + t * (b.fov - a.fov),
    distance: a.distance + t * (b.distance - a.distance),
  };
}

// A transforms.json of nerfstudio: OpenGL camera axes (right, up, back), one frame per picture.
export function pathFile(keys, { seconds, fps, closed, width, height }) {
  const count = Math.max(1, Math.round(seconds * fps));
  const last = closed ? count : Math.max(count - 1, 1);
  const frames = [];
  for (let i = 0; i < count; ++i) {
    const view = viewAt(keys, i / last, closed);
    const [right, down, forward] = v.axesOf(view.turn);
    const focal = 0.5 * height / Math.tan(0.5 * view.fov * Math.PI / 180);
    frames.push({
      file_path: `frame_${String(i).padStart(5, '0')}.png`,
      fl_x: focal, fl_y: focal, cx: width / 2, cy: height / 2, w: width, h: height,
      transform_matrix: [
        ...[0, 1, 2].map((k) => [right[k], -down[k], -forward[k], view.eye[k]]),
        [0, 0, 0, 1],
      ],
    });
  }
  return { camera_model: 'PINHOLE', fps, frames, raysplats_keyframes: { keys, seconds, fps, closed } };
}

// The keyframes of a file that pathFile() made; null for any other.
export function keyframesOf(file) {
  const stored = file && file.raysplats_keyframes;
  const numbers = (list, n) => Array.isArray(list) && list.length === n && list.every(Number.isFinite);
  const sound = stored && Array.isArray(stored.keys) && stored.keys.every((key) => key
    && numbers(key.eye, 3) && numbers(key.turn, 4) && numbers([key.fov, key.distance], 2));
  return sound ? stored : null;
}
