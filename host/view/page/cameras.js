// SPDX-License-Identifier: Apache-2.0
// The cameras of the data set: a list, and frustums over the picture. The one under the pointer has its name and its
// photo in it.

import { fetchPhoto } from './photo.js';
import * as v from './vectors.js';

const NEAR = 14; // pixels from a frustum's tip that a click may be off
const MOST = 512; // that are drawn
const THUMB = 256; // pixels across of a photo in its frustum
const KEPT = 64; // photos

function corners(camera, depth) {
  const half = depth * Math.tan(0.5 * camera.fov * Math.PI / 180);
  const wide = half * camera.aspect;
  const point = (x, y) => [0, 4, 8].map((row) => camera.c2w[row] * x + camera.c2w[row + 1] * y
    + camera.c2w[row + 2] * depth + camera.c2w[row + 3]);
  return [point(-wide, -half), point(wide, -half), point(wide, half), point(-wide, half)];
}

const eyeOf = (camera) => [camera.c2w[3], camera.c2w[7], camera.c2w[11]];

export class TrainingCameras {
  #under = null; // the camera under the pointer
  #photos = new Map(); // by camera

  // `choose(camera)` when one is taken from the list, `redraw()` when a photo has come.
  constructor(list, choose, redraw) {
    this.list = list;
    this.redraw = redraw;
    this.shown = false;
    this.all = [];
    list.addEventListener('change', () => choose(this.all[list.selectedIndex]));
  }

  fill(cameras, center) {
    this.all = cameras;
    this.#under = null;
    this.#photos.clear();
    this.list.replaceChildren(...cameras.map((camera) => new Option(camera.name)));
    const distances = cameras.map((camera) => v.length(v.sub(eyeOf(camera), center)));
    distances.sort((a, b) => a - b);
    this.size = 0.06 * (distances[Math.floor(distances.length / 2)] || 1);
  }

  draw(context, rig, width, height) {
    if (!this.shown) return;
    context.strokeStyle = '#f0a030';
    context.lineWidth = 1.2;
    const step = Math.ceil(this.all.length / MOST);
    for (let i = 0; i < this.all.length; i += step) {
      const eye = rig.project(eyeOf(this.all[i]), width, height);
      const far = corners(this.all[i], this.size).map((p) => rig.project(p, width, height));
      if (!eye || far.includes(null)) continue;
      context.beginPath();
      for (let k = 0; k < 4; ++k) {
        context.moveTo(...eye);
        context.lineTo(...far[k]);
        context.lineTo(...far[(k + 1) % 4]);
      }
      context.stroke();
    }
    this.#drawUnder(context, rig, width, height);
  }

  #drawUnder(context, rig, width, height) {
    if (!this.#under) return;
    const [first, across, , down] = corners(this.#under, this.size).map((p) => rig.project(p, width, height));
    if (!first || !across || !down) return;
    const photo = this.#photos.get(this.#under);
    context.save();
    context.fillStyle = '#f0a030';
    context.fillText(this.#under.name, first[0], first[1] - 4);
    if (photo) {
      // What is so small has next to no perspective.
      const [a, b] = [across, down].map((p) => [p[0] - first[0], p[1] - first[1]]);
      context.transform(a[0], a[1], b[0], b[1], first[0], first[1]);
      context.drawImage(photo, 0, 0, 1, 1);
    }
    context.restore();
  }

  // The pointer rests at a place of the picture.
  async hover(rig, x, y, width, height) {
    const found = this.at(rig, x, y, width, height);
    if (found === this.#under) return;
    this.#under = found;
    this.redraw();
    if (!found?.photo || this.#photos.has(found)) return;
    const photo = await fetchPhoto(this.all.indexOf(found), THUMB);
    if (!photo) return;
    this.#photos.set(found, photo);
    if (this.#photos.size > KEPT) this.#photos.delete(this.#photos.keys().next().value);
    this.redraw();
  }

  // The camera whose tip is seen next to a place, null for none.
  at(rig, x, y, width, height) {
    if (!this.shown) return null;
    let best = null;
    let least = NEAR;
    for (const camera of this.all) {
      const tip = rig.project(eyeOf(camera), width, height);
      const off = tip ? Math.hypot(tip[0] - x, tip[1] - y) : Infinity;
      if (off < least) {
        least = off;
        best = camera;
      }
    }
    return best;
  }
}
