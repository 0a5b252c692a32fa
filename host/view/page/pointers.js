// SPDX-License-Identifier: Apache-2.0
// Mouse and fingers on one element.

export class Pointers {
  #down = new Map(); // by pointer: where it is
  #moved = 0; // pixels since the first one came down

  // `on` has drag(dx, dy, sideways), zoom(factor), click(x, y), pick(x, y) and `slip` in pixels.
  constructor(element, on) {
    this.element = element;
    this.on = on;
    element.addEventListener('pointerdown', (event) => this.#press(event));
    element.addEventListener('pointermove', (event) => this.#move(event));
    for (const type of ['pointerup', 'pointercancel']) {
      element.addEventListener(type, (event) => this.#release(event));
    }
    element.addEventListener('dblclick', (event) => this.on.pick(event.offsetX, event.offsetY));
    element.addEventListener('contextmenu', (event) => event.preventDefault());
    element.addEventListener('wheel', (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 30 : 1;
      this.on.zoom(Math.exp(Math.min(Math.max(event.deltaY * lines, -300), 300) * 0.0012));
    }, { passive: false });
  }

  #press(event) {
    this.element.setPointerCapture(event.pointerId);
    this.element.focus();
    if (this.#down.size === 0) this.#moved = 0;
    this.#down.set(event.pointerId, [event.clientX, event.clientY]);
  }

  // The middle of all pointers, and how far apart two are.
  #shape() {
    const places = [...this.#down.values()];
    const middle = [0, 1].map((k) => places.reduce((sum, p) => sum + p[k], 0) / places.length);
    const spread = places.length > 1
      ? Math.hypot(places[0][0] - places[1][0], places[0][1] - places[1][1]) : 0;
    return { middle, spread };
  }

  #move(event) {
    if (!this.#down.has(event.pointerId)) return;
    const before = this.#shape();
    this.#down.set(event.pointerId, [event.clientX, event.clientY]);
    const after = this.#shape();
    const [dx, dy] = [0, 1].map((k) => after.middle[k] - before.middle[k]);
    this.#moved += Math.hypot(dx, dy);
    const several = this.#down.size > 1;
    const sideways = several || event.shiftKey || (event.buttons & 6) !== 0;
    if (dx !== 0 || dy !== 0) this.on.drag(dx, dy, sideways);
    if (several && before.spread > 0 && after.spread > 0) this.on.zoom(before.spread / after.spread);
  }

  #release(event) {
    const alone = this.#down.size === 1;
    this.#down.delete(event.pointerId);
    if (event.type === 'pointerup' && alone && this.#moved <= this.on.slip) {
      this.on.click(event.offsetX, event.offsetY);
    }
  }
}
