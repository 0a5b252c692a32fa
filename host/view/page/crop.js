// SPDX-License-Identifier: Apache-2.0
// A box in the world: sliders move its faces, the option of `raysplats convert` that keeps what is in
// it stands below.

const REACH = 2; // of the sliders, in radii of the model
const STEPS = 200;
const MOST_PLACES = 100; // of toFixed()
const NEAR = 1e-3; // depth, in radii, in front of which edges are cut

export class Crop {
  // `parent` gets the sliders, `text` the option.
  constructor(parent, text, redraw) {
    this.parent = parent;
    this.text = text;
    this.redraw = redraw;
    this.shown = false;
  }

  // `origin` is that of the model in the coordinates of its data set, which `convert` crops in.
  begin(center, radius, origin) {
    this.radius = radius;
    this.origin = origin;
    this.low = center.map((x) => x - radius / 2);
    this.high = center.map((x) => x + radius / 2);
    const rows = ['x', 'y', 'z'].flatMap((name, axis) => ['low', 'high'].map((end) => {
      const slider = document.createElement('input');
      slider.type = 'range';
      slider.id = `crop-${end}-${name}`;
      slider.min = center[axis] - REACH * radius;
      slider.max = center[axis] + REACH * radius;
      slider.step = 2 * REACH * radius / STEPS;
      slider.value = this[end][axis];
      slider.addEventListener('input', () => this.move(axis, end, Number(slider.value)));
      const label = document.createElement('label');
      label.append(`${end === 'low' ? 'From' : 'To'} ${name}`, slider);
      return label;
    }));
    this.parent.replaceChildren(...rows);
    this.say();
  }

  // The faces do not pass each other.
  move(axis, end, value) {
    this[end][axis] = end === 'low' ? Math.min(value, this.high[axis]) : Math.max(value, this.low[axis]);
    this.say();
    this.redraw();
  }

  say() {
    // As fine as the box needs, wherever it lies.
    const places = Math.min(Math.max(0, 3 - Math.floor(Math.log10(this.radius))), MOST_PLACES);
    const numbers = (v) => v.map((x, axis) => Number((x + this.origin[axis]).toFixed(places))).join(',');
    this.text.textContent = `--crop-min ${numbers(this.low)} --crop-max ${numbers(this.high)}`;
  }

  draw(context, rig, width, height) {
    if (!this.shown) return;
    const corner = (i) => [0, 1, 2].map((axis) => (i >> axis & 1 ? this.high : this.low)[axis]);
    const depth = (p) => p.reduce((sum, x, axis) => sum + (x - rig.eye[axis]) * rig.axes[2][axis], 0);
    context.strokeStyle = '#35b0f0';
    context.lineWidth = 1.5;
    context.beginPath();
    for (let i = 0; i < 8; ++i) {
      for (let axis = 0; axis < 3; ++axis) {
        if (i >> axis & 1) continue;
        let ends = [corner(i), corner(i | 1 << axis)];
        const near = NEAR * this.radius;
        const [a, b] = ends.map(depth);
        if (a < near && b < near) continue;
        // What lies behind the camera is cut off.
        const cut = ends[0].map((x, k) => x + (near - a) / (b - a) * (ends[1][k] - x));
        if (a < near) ends = [cut, ends[1]];
        else if (b < near) ends = [ends[0], cut];
        const [from, to] = ends.map((p) => rig.project(p, width, height));
        if (!from || !to) continue;
        context.moveTo(...from);
        context.lineTo(...to);
      }
    }
    context.stroke();
  }
}
