// SPDX-License-Identifier: Apache-2.0
// A camera that people move: its axes are right, down, forward, as the tracer has them.

import * as v from './vectors.js';

const STEEPEST = 0.995; // cosine between forward and up at which turning up or down ends

export class Rig {
  constructor(up) {
    this.up = v.normalized(up);
    this.eye = [0, 0, 0];
    this.target = [0, 0, 1];
    this.axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    this.fov = 50;
    this.model = 'pinhole';
  }

  // Degrees that the lens may see along the height.
  get widest() {
    return this.model === 'fisheye' ? 360 : 120;
  }

  set lens(model) {
    this.model = model;
    this.fov = Math.min(this.fov, this.widest);
  }

  // What a pixel in the middle of a picture of this height covers at the centre to turn around.
  pixel(height) {
    const half = 0.5 * this.fov * Math.PI / 180;
    const radius = { pinhole: Math.tan(half), fisheye: half, equirectangular: Math.PI / 2 }[this.model];
    return 2 * this.distance * radius / height;
  }

  // 3 x 4 by rows, row after row: axes and eye to the world.
  get pose() {
    const [x, y, z] = this.axes;
    return [0, 1, 2].flatMap((i) => [x[i], y[i], z[i], this.eye[i]]);
  }

  set pose(c2w) {
    this.axes = [0, 1, 2].map((k) => [c2w[k], c2w[4 + k], c2w[8 + k]]);
    this.eye = [c2w[3], c2w[7], c2w[11]];
  }

  // The centre to turn around stays as far away as it was, or as near as the view comes to `point`.
  face(point) {
    const distance = v.dot(v.sub(point, this.eye), this.axes[2]);
    const forward = distance > 0 ? distance : v.length(v.sub(point, this.eye));
    this.target = v.add(this.eye, v.scale(this.axes[2], Math.max(forward, 1e-6)));
  }

  get distance() {
    return v.length(v.sub(this.target, this.eye));
  }

  #rotate(yaw, pitch) {
    const steep = v.dot(v.turned(this.axes[2], this.axes[0], pitch), this.up);
    const now = v.dot(this.axes[2], this.up);
    const tilt = Math.abs(steep) > STEEPEST && Math.abs(steep) > Math.abs(now) ? 0 : pitch;
    this.axes = this.axes.map((axis) => v.turned(v.turned(axis, this.axes[0], tilt), this.up, yaw))
      .map(v.normalized);
  }

  orbit(yaw, pitch) {
    const distance = this.distance;
    this.#rotate(yaw, pitch);
    this.eye = v.sub(this.target, v.scale(this.axes[2], distance));
  }

  look(yaw, pitch) {
    const distance = this.distance;
    this.#rotate(yaw, pitch);
    this.target = v.add(this.eye, v.scale(this.axes[2], distance));
  }

  // Along the axes, in world units.
  move(right, down, forward) {
    const step = v.add(v.add(v.scale(this.axes[0], right), v.scale(this.axes[1], down)),
      v.scale(this.axes[2], forward));
    this.eye = v.add(this.eye, step);
    this.target = v.add(this.target, step);
  }

  // The distance to the centre times `factor`.
  zoom(factor) {
    this.eye = v.add(this.target, v.scale(v.sub(this.eye, this.target), factor));
  }

  // The centre goes to `point`, which then lies ahead.
  center(point) {
    this.target = point;
    this.#aim(v.normalized(v.sub(point, this.eye)));
  }

  level() {
    this.#aim(this.axes[2]);
  }

  #aim(forward) {
    let right = v.cross(v.scale(this.up, -1), forward);
    if (v.length(right) < 1e-6) right = this.axes[0];
    right = v.normalized(right);
    this.axes = [right, v.normalized(v.cross(forward, right)), forward];
  }

  // Where a pinhole sees a point of the world: [column, row] of a picture of this size, null from
  // behind.
  project(point, width, height) {
    const ray = v.sub(point, this.eye);
    const depth = v.dot(ray, this.axes[2]);
    if (depth <= 1e-6) return null;
    const focal = 0.5 * height / Math.tan(0.5 * this.fov * Math.PI / 180);
    return [width / 2 + focal * v.dot(ray, this.axes[0]) / depth,
      height / 2 + focal * v.dot(ray, this.axes[1]) / depth];
  }

  get keyframe() {
    return { eye: [...this.eye], turn: v.quaternionOf(this.axes), fov: this.fov, distance: this.distance };
  }

  set keyframe(key) {
    this.eye = [...key.eye];
    this.axes = v.axesOf(key.turn);
    this.fov = key.fov;
    this.target = v.add(this.eye, v.scale(this.axes[2], key.distance));
  }
}
