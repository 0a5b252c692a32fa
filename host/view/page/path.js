// SPDX-License-Identifier: Apache-2.0
// Camera paths through keyframes, and their files: what `raysplats render --path` and nerfstudio read.

import * as v from './vectors.js';

// Pixels of the frames of files that do not say them.
export const WIDTH = 1920;
export const HEIGHT = 1080;
const ZERO = [0, 0, 0];
const PIECES = 64; // straight ones, of a span whose length is measured

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

// Where along the spans equal steps are: ascending distances at known places, number of the span plus
// share of it.
function rulerOf(spans, pieces, length) {
  const marks = [{ distance: 0, place: 0 }];
  for (let span = 0; span < spans; ++span) {
    for (let i = 1; i <= pieces; ++i) {
      const { distance } = marks[marks.length - 1];
      marks.push({ distance: distance + length(span, (i - 1) / pieces, i / pieces), place: span + i / pieces });
    }
  }
  return marks;
}

// A path as `raysplats render` goes along it: the view at a share (0 to 1) of its time.
export function courseOf(keys, { closed, constant }) {
  if (keys.length === 1) return () => keys[0];
  const spans = closed ? keys.length : keys.length - 1;
  const key = (i) => (closed ? keys[(i + keys.length) % keys.length]
    : keys[Math.min(Math.max(i, 0), keys.length - 1)]);
  // Beyond an end the path goes on as it came.
  const place = (i, from, to) => (closed || (i >= 0 && i < keys.length) ? key(i).eye
    : v.sub(v.scale(from, 2), to));
  const eye = (i, t) => {
    const [a, b] = [key(i).eye, key(i + 1).eye];
    return smooth(place(i - 1, a, b), a, b, place(i + 2, b, a), t);
  };
  const bySeconds = rulerOf(spans, 1, (i) => key(i).seconds ?? 1);
  const rulers = [bySeconds, rulerOf(spans, 1, () => 1)];
  if (constant) rulers.unshift(rulerOf(spans, PIECES, (i, from, to) => v.length(v.sub(eye(i, to), eye(i, from)))));
  // One that turns on the spot has no length, and one may be without seconds.
  const ruler = rulers.find((marks) => marks[marks.length - 1].distance > 0);
  return (share) => {
    const wanted = share * ruler[ruler.length - 1].distance;
    const after = ruler.findIndex((mark) => mark.distance > wanted);
    let at = spans;
    if (after > 0) {
      const [from, to] = [ruler[after - 1], ruler[after]];
      at = from.place + (wanted - from.distance) / (to.distance - from.distance) * (to.place - from.place);
    }
    const index = Math.min(Math.floor(at), spans - 1);
    const t = at - index;
    const [a, b] = [key(index), key(index + 1)];
    return {
      eye: eye(index, t),
      turn: v.slerp(a.turn, b.turn, t),
      fov: a.fov + t * (b.fov - a.fov),
      distance: a.distance + t * (b.distance - a.distance),
    };
  };
}

// 4 x 4 by rows, with nerfstudio's camera axes (right, up, back), in the world of the data set's files,
// of which `origin` is where the page's coordinates begin.
function matrixOf({ eye: own, turn }, origin) {
  const eye = v.add(own, origin);
  const [right, down, forward] = v.axesOf(turn);
  return [...[0, 1, 2].flatMap((k) => [right[k], -down[k], -forward[k], eye[k]]), 0, 0, 0, 1];
}

// The view of such a matrix; as text it is by columns, as nerfstudio's add-ons write it.
function viewOf(matrix, fov, distance, origin) {
  let m = matrix;
  if (typeof matrix === 'string') {
    const columns = (matrix.match(/-?[\d.]+(?:e[-+]?\d+)?/gi) || []).map(Number);
    m = columns.map((_, i) => columns[4 * (i % 4) + Math.floor(i / 4)]);
  }
  m = m.flat();
  const axis = (k, sign) => v.normalized([sign * m[k], sign * m[4 + k], sign * m[8 + k]]);
  return {
    eye: v.sub([m[3], m[7], m[11]], origin),
    turn: v.quaternionOf([axis(0, 1), axis(1, -1), axis(2, -1)]),
    fov,
    distance,
  };
}

const TYPES = { pinhole: 'perspective', fisheye: 'fisheye', equirectangular: 'equirectangular' };
const DEGREE = Math.PI / 180;

// nerfstudio gives a fisheye the focal length of the pinhole with that angle.
const fileFov = (model, fov) => (model === 'fisheye' ? 2 * Math.atan(fov * DEGREE / 2) / DEGREE : fov);
const lensFov = (model, fov) => (model === 'fisheye' ? 2 * Math.tan(fov * DEGREE / 2) / DEGREE : fov);

// nerfstudio's seconds are those of the way to a keyframe, from the last to the first where the path
// is closed; here a key has those of the way that it begins.
function transitions(keys, seconds, closed) {
  const own = keys.map((key) => key.seconds ?? 1);
  const sum = own.slice(0, closed ? keys.length : -1).reduce((total, each) => total + each, 0);
  return keys.map((_, i) => own[(i + keys.length - 1) % keys.length] * (sum > 0 ? seconds / sum : 1));
}

// A camera path of nerfstudio: its frames one by one, and the keyframes that they are made of. `origin`
// is that of the model (api/state), which `raysplats render --path` takes off again.
export function pathFile(keys, { seconds, fps, closed, constant, width, height, model }, origin = ZERO) {
  const count = Math.max(1, Math.round(seconds * fps));
  const last = closed ? count : Math.max(count - 1, 1);
  const aspect = width / height;
  const course = courseOf(keys, { closed, constant });
  const camera_path = [];
  for (let i = 0; i < count; ++i) {
    const view = course(i / last);
    camera_path.push({ camera_to_world: matrixOf(view, origin), fov: fileFov(model, view.fov), aspect });
  }
  const ways = transitions(keys, seconds, closed);
  return {
    camera_type: TYPES[model],
    render_width: width,
    render_height: height,
    fps,
    seconds,
    is_cycle: closed,
    default_transition_sec: seconds / Math.max(closed ? keys.length : keys.length - 1, 1),
    raysplats_constant_speed: constant,
    keyframes: keys.map((key, i) => ({
      matrix: matrixOf(key, origin),
      fov: fileFov(model, key.fov),
      aspect,
      override_transition_enabled: true,
      override_transition_sec: ways[i],
      raysplats_distance: key.distance,
    })),
    camera_path,
  };
}

// The keyframes of a camera path, of this page or of nerfstudio; null for any other file.
// `distance` is that of the centre to turn around where the file does not say it, `origin` as above.
export function keyframesOf(file, distance, origin = ZERO) {
  const list = file && (file.keyframes?.length ? file.keyframes : file.camera_path);
  if (!Array.isArray(list) || list.length === 0) return null;
  const model = Object.keys(TYPES).find((each) => TYPES[each] === (file.camera_type ?? 'perspective'));
  if (!model) return null;
  const keys = list.map((key) => viewOf(key.matrix ?? key.camera_to_world,
    lensFov(model, Number(key.fov ?? file.default_fov ?? 50)), Number(key.raysplats_distance ?? distance), origin));
  if (file.keyframes?.length) {
    const common = Number(file.default_transition_sec ?? 1);
    const ways = list.map((key) => (key.override_transition_enabled === true
      ? Number(key.override_transition_sec ?? common) : common));
    keys.forEach((key, i) => { key.seconds = ways[(i + 1) % ways.length]; });
  }
  const sound = keys.every((key) => [...key.eye, ...key.turn, key.fov, key.distance, key.seconds ?? 1]
    .every(Number.isFinite));
  if (!sound) return null;
  const fps = Number(file.fps) || 30;
  return {
    keys,
    model,
    fps,
    closed: file.is_cycle === true,
    constant: file.raysplats_constant_speed === true,
    seconds: Number(file.seconds) || list.length / fps,
    width: Number(file.render_width) || WIDTH,
    height: Number(file.render_height) || HEIGHT,
  };
}
